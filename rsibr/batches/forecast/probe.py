"""Probe of a batch: small jobs of each group in a process of its own, as a worker would run them.

For each group a job is run three times, small: for the first time, again with few and with more samples, and twice more
with the steps after the bake, if there are any. The shares of material, sky, bake, map, texel, sample and steps follow
from the differences. One more job lies under another sky. A material that ends the process ends only the probe of its
group.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rsibr.batches.forecast.kinds import Census, Kind, Size
from rsibr.batches.forecast.rates import Rates, SharedRates
from rsibr.errors import MachineError
from rsibr.progress import Progress
from rsibr.scene.interpreter import interpreters, search_path

MOST_PROBED = 12
"""Groups that are probed; more of them are taken as the mean of these."""

LARGEST_SIDE = 256
"""Texels a side of the maps of a probe, at most; those of larger maps are scaled."""

FEW_SAMPLES = 4
MANY_SAMPLES = 2**24
"""Samples a texel of the short job, and samples of all maps of the long one, at most."""


@dataclass(frozen=True)
class Planned:
    """Size of a kind as it is planned.

    Attributes
    ----------
    size : Size
    map_bytes : float
        Bytes of all maps.
    """

    size: Size
    map_bytes: float


@dataclass(frozen=True)
class Probed:
    """What a probe found.

    Attributes
    ----------
    rates : dict of str to Rates
        By the text of the group.
    planned : dict of int to Planned
        By the identity of the kind.
    shared : SharedRates
    notes : tuple of str
        Groups that could not be probed, and why.
    """

    rates: dict[str, Rates]
    planned: dict[int, Planned]
    shared: SharedRates
    notes: tuple[str, ...]


def probe(census: Census, threads: int, on_progress: Callable[[Progress], None] = lambda _: None) -> Probed:
    """Run small jobs of each group.

    Parameters
    ----------
    census : Census
        All jobs.
    threads : int
        Threads of a worker.
    on_progress : callable
        Called after each group.

    Raises
    ------
    MachineError
        If no Python interpreter can run the probe, or no group can be probed.
    """
    groups = _spread(list(census.groups().items()))
    asked = [_asked(kinds) for _, kinds in groups]
    skies = census.sky_examples
    then = groups[0][1][0].example.then.to_record()
    request = {
        "threads": threads,
        "sky": dict(skies[1].settings["environment"]) if len(skies) > 1 else None,
        "then": then if any(then.values()) else None,
    }
    run = _Run(request, on_progress)
    answers = run.answers(asked)
    notes = [
        f"{kinds[0].material}: {answer['error']}"
        for (_, kinds), answer in zip(groups, answers, strict=True)
        if "error" in answer
    ]
    good = [pair for pair in zip(groups, answers, strict=True) if "error" not in pair[1]]
    if not good:
        raise MachineError(
            f"no job could be probed ({'; '.join(notes)})", fix="see `rsibr plan` for a config of its own"
        )
    return _found(good, run, notes)


def _spread(groups: list[tuple[str, list[Kind]]]) -> list[tuple[str, list[Kind]]]:
    """At most `MOST_PROBED` groups, evenly spread."""
    step = max(1.0, len(groups) / MOST_PROBED)
    return [groups[int(n * step)] for n in range(min(len(groups), MOST_PROBED))]


def _asked(kinds: Sequence[Kind]) -> dict[str, Any]:
    """Request for a group: its largest job, made smaller, and the configs of all its kinds."""
    largest = max(kinds, key=lambda kind: kind.size.resolution)  # what a map costs beside its texels is then little
    size, job = largest.size, largest.example
    settings = {name: table for name, table in job.settings.items() if name != "budget"}
    if size.resolution > LARGEST_SIDE:
        settings["map"] = {"resolution": LARGEST_SIDE}
    if size.views > 12:
        settings["views"] = {"subdivision": 0}
    texels = min(size.views, 12) * min(size.resolution, LARGEST_SIDE) ** 2
    many = min(max(kind.size.samples for kind in kinds), max(4 * FEW_SAMPLES, MANY_SAMPLES // texels))
    small = replace(job, settings=settings, digest="", then=type(job.then)())
    environment = settings["environment"]
    return {
        "job": small.to_record(),
        "samples": [FEW_SAMPLES, many],
        "sized": [{**kind.example.settings, "environment": environment} for kind in kinds],
    }


class _Run:
    """Runs the child, again after a crash, and keeps what it says about what groups share."""

    def __init__(self, request: dict[str, Any], on_progress: Callable[[Progress], None]) -> None:
        self._request, self._on_progress = request, on_progress
        self.seconds = self.imports = 0.0
        self.runs = 0
        self.shared: dict[str, Any] = {}

    def answers(self, asked: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Answer for each group."""
        found: list[dict[str, Any]] = []
        while len(found) < len(asked):
            rest = asked[len(found) :]
            (begun, *said), code, seconds = self._child(rest, len(found), len(asked))
            self.imports = begun["imports"]
            self.seconds, self.runs = self.seconds + seconds, self.runs + 1
            for one in said[len(rest) :]:
                self.shared.update({key: one[key] for key in ("sky", "light") if key in one})
                self.seconds -= one.get("spent", 0.0)
            found += said[: len(rest)]
            if len(said) < len(rest):  # the child ended in this group
                found.append({"error": f"ended its process ({_ending(code)})"})
        return found

    def _child(self, groups: list[dict[str, Any]], done: int, total: int) -> tuple[list[dict[str, Any]], int, float]:
        """Answers of one child, its exit code, and its processor time [s]."""
        interpreter = next(iter(interpreters()), None)
        if interpreter is None:
            raise MachineError("no Python interpreter was found to probe with", fix="use --no-probe")
        before = sum(os.times()[2:4])
        child = subprocess.Popen(
            [interpreter, "-P", "-m", "rsibr.batches.forecast.probe_child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": search_path()},
            text=True,
        )
        assert child.stdin is not None
        assert child.stdout is not None
        said: list[dict[str, Any]] = []
        with child:
            child.stdin.write(json.dumps({**self._request, "groups": groups}))
            child.stdin.close()
            for line in child.stdout:
                said.append(json.loads(line))
                number = min(done + len(said), total)
                if len(said) <= len(groups):
                    self._on_progress(Progress(number - 1, total, f"probing kind {number} of {total}"))
        if not said:
            raise MachineError(f"the probe did not start ({_ending(child.returncode)})", fix="use --no-probe")
        return said, child.returncode, sum(os.times()[2:4]) - before


def _ending(code: int) -> str:
    if code >= 0:
        return f"exit code {code}"
    return signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"


def _found(good: Sequence[tuple[tuple[str, list[Kind]], dict[str, Any]]], run: _Run, notes: Sequence[str]) -> Probed:
    """Shares of each part, from the differences between the runs."""
    answers, shared = [answer for _, answer in good], run.shared
    sky = max(0.0, shared.get("sky", 0.0))
    once = [answer["first"] - answer["again"][0] + answer["then"][0] - answer["then"][1] for answer in answers]
    others = [max(0.0, seconds) for seconds in once[1:]]
    first = max(0.0, once[0] - sky)
    material = sum(others) / len(others) if others else first
    spent = sum(answer["spent"] for answer in answers)
    start = max(0.0, run.seconds / run.runs - spent / run.runs) + max(0.0, first - material)
    lights = {answer["light"]: answer["light_bytes"] for answer in answers}  # of the materials under one sky
    other = shared.get("light", answers[-1]["light_bytes"]) / answers[-1]["light_bytes"]
    light_bytes = sum(lights.values()) / len(lights) * (1 + other) / 2
    rates, planned = dict[str, Rates](), dict[int, Planned]()
    for number, ((group, kinds), answer) in enumerate(good):
        own = others[number - 1] if number else min(first, material)
        rates[group] = _rates(kinds, answer, own)
        planned |= {id(kind): _planned(kind, sized) for kind, sized in zip(kinds, answer["sized"], strict=True)}
    return Probed(rates, planned, SharedRates(start, run.imports, sky, light_bytes, len(lights)), tuple(notes))


def _rates(kinds: Sequence[Kind], answer: dict[str, Any], material: float) -> Rates:
    side, views = answer["resolution"], answer["views"]
    few, many = _asked(kinds)["samples"]
    size = Size(views, side, 1)
    sample = max(0.0, answer["again"][1] - answer["again"][0]) / (size.samples_in_all * (many - few))
    store = min(answer["store"], answer["again"][0] / views) / side**2
    pair = max(0.0, answer["again"][0] - size.samples_in_all * few * sample - size.texels * store)
    return Rates(
        material=material,
        pair=pair,
        view=0.0,
        store=store,
        sample=sample,
        then=answer["then"][1] / side**2,
        beside=answer["beside"],
        files=answer["files"],
        then_bytes=answer["then_bytes"] / size.texels,
        then_files=answer["then_files"] / views,
        texel_bytes=answer["map_bytes"] / side**2,
    )


def _planned(kind: Kind, sized: dict[str, Any]) -> Planned:
    samples = kind.size.samples if sized["samples"] is None else sized["samples"]
    return Planned(Size(sized["views"], sized["resolution"], samples), sized["map_bytes"])
