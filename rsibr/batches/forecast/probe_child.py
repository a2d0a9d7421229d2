"""Child process of `rsibr.batches.forecast.probe`: runs small jobs of each group, and says what they took.

`python -m rsibr.batches.forecast.probe_child` reads one JSON object from stdin, see `rsibr.batches.forecast.probe`, and
prints a line of JSON for each group. It runs the jobs as a worker does, by `rsibr.batches.worker.run_job`.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rsibr import backend
from rsibr.baking.calibration import map_overhead
from rsibr.baking.sampling import Sampler
from rsibr.baking.scene import Scene
from rsibr.batches.job import Job, Then
from rsibr.batches.then import PUBLISHED_NAME, REPORTS_NAME
from rsibr.batches.worker import run_job
from rsibr.errors import CheckFailed, RsibrError
from rsibr.planning.costs import Costs, priced
from rsibr.scene.config import parse_config
from rsibr.store.manifest import MANIFEST_NAME, MAPS_NAME, read_manifest


def main() -> None:
    """Probe the groups of the object on stdin."""
    asked = json.load(sys.stdin)
    with os.fdopen(os.dup(1), "w") as answers, TemporaryDirectory(prefix="rsibr-probe-") as folder:
        os.dup2(2, 1)  # Mitsuba logs to it
        with redirect_stdout(sys.stderr):
            for answer in _answers(asked, Path(folder)):
                print(json.dumps(answer), file=answers, flush=True)  # for the parent process


def _answers(asked: Mapping[str, Any], folder: Path) -> Iterator[dict[str, Any]]:
    yield {"imports": processor_seconds()}
    then = None if asked["then"] is None else Then.from_record(asked["then"])
    probe = _Probe(folder, asked["threads"], then)
    for group in asked["groups"]:
        yield _told(lambda group=group: probe.group(group))  # type: ignore[misc]
    if asked["sky"] is not None:
        yield _told(lambda: probe.under_another_sky(asked["sky"]))


def _told(work: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    try:
        return work()
    except RsibrError as error:
        return {"error": str(error)}


class _Probe:
    """Runs jobs in a folder, each under a name of its own."""

    def __init__(self, folder: Path, threads: int, then: Then | None) -> None:
        self._folder, self._threads, self._then, self._count = folder, threads, then, 0
        self.last: Job

    def run(self, job: Job) -> float:
        """Processor time of a job [s]."""
        self._count += 1
        self.last = replace(job, name=f"probe-{self._count}", digest="")
        before = processor_seconds()
        result = run_job(self.last, self._folder, threads=self._threads)
        if result.state != "done":
            raise CheckFailed(result.reason or "failed", where=job.name)
        return processor_seconds() - before

    @property
    def _light(self) -> tuple[str, int]:
        """Checksum and size of the light of the last bake."""
        light = read_manifest(self._folder / self.last.bake / MANIFEST_NAME).light
        assert light is not None
        return light.sha256, light.bytes

    def again(self, job: Job, samples: int) -> float:
        """Processor time of a job with another number of samples, whose material and sky are known [s]."""
        sampling = {name: value for name, value in job.settings["sampling"].items() if name not in _COUNTS}
        return self.run(replace(job, settings={**job.settings, "sampling": {**sampling, "samples": samples}}))

    def under_another_sky(self, environment: Mapping[str, Any]) -> dict[str, Any]:
        """What the last job takes more under a sky that is not known yet."""
        other = replace(self.last, then=Then(), settings={**self.last.settings, "environment": environment})
        first, again = self.run(other), self.run(other)
        return {"sky": first - again, "light": self._light[1], "spent": first + again}

    def _steps(self, without: float) -> dict[str, Any]:
        """What the steps after the last job take, for the first time and again, and what they write."""
        if self._then is None:
            return {"then": [0.0, 0.0], "then_bytes": 0, "then_files": 0}
        first, again = (self.run(replace(self.last, then=self._then)) for _ in range(2))
        folders = (self._folder / name / self.last.name for name in (REPORTS_NAME, PUBLISHED_NAME))
        sizes = [file.stat().st_size for folder in folders for file in folder.rglob("*") if file.is_file()]
        then = [max(0.0, first - without), max(0.0, again - without)]
        return {"then": then, "then_bytes": sum(sizes), "then_files": len(sizes)}

    def group(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """What a group takes: a job for the first time, again, and with more samples; and how it is planned."""
        job, samples = Job.from_record(asked["job"]), asked["samples"]
        first = self.again(job, samples[0])
        again = [self.again(job, count) for count in samples]
        begun, baked = processor_seconds(), self.last
        bake = self._folder / baked.bake
        maps = [file.stat().st_size for file in (bake / MAPS_NAME).glob("*.exr")]
        files = [file for file in bake.rglob("*") if file.is_file()]
        beside = sum(file.stat().st_size for file in files) - sum(maps)
        light, light_bytes = self._light
        scene = Scene.prepare(parse_config(baked.settings, Path()))
        return {
            "first": first,
            "again": again,
            "views": len(maps),
            "resolution": scene.resolution,
            "beside": beside + (self._folder / baked.result).stat().st_size,
            "files": len(files) - len(maps) + 1,
            "light": light,
            "light_bytes": light_bytes,
            "map_bytes": sum(maps) / len(maps),
            "store": map_overhead(scene.integrator),
            "sized": [_planned(scene, settings, sum(maps) / len(maps)) for settings in asked["sized"]],
            **self._steps(again[-1]),
            "spent": first + sum(again) + processor_seconds() - begun,
        }


_COUNTS = ("samples", "target_error", "time_budget_s")


def _planned(scene: Scene, settings: Mapping[str, Any], map_bytes: float) -> dict[str, Any]:
    """Size of a bake as the plan makes it, and the bytes of its maps."""
    config = parse_config({name: table for name, table in settings.items() if name != "budget"}, Path())
    sized = scene.resized(config)
    each = map_bytes * (sized.resolution / scene.resolution) ** 2
    costs = Costs(len(sized.all_around), len(sized.integrator.lobe_names), 0.0, round(each))
    samples = None
    if config.sampling.target_error is not None:
        with backend.rendering(sized.rendering):
            record = Sampler(sized.integrator, sized.frames, config.sampling).choose(0.0)
        samples = record.block * record.even
    return {
        "views": len(sized.viewpoints),
        "resolution": sized.resolution,
        "samples": samples,
        "map_bytes": priced(sized.plan, costs, config.map.side).bytes,
    }


def processor_seconds() -> float:
    """Processor time of this process and of the ended ones that it has started [s]."""
    return sum(os.times()[:4])


if __name__ == "__main__":
    main()
