"""Measures one scene: its truth, path tracing as a rival, its bakes, and every picture made of them."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rsibr.bake.atomic import checksum
from rsibr.bake.baker import bake
from rsibr.bake.manifest import canonical
from rsibr.bake.store import Bake
from rsibr.errors import BakeError
from rsibr.reconstruct.lobed import LobedMethod
from rsibr.reconstruct.methods import MethodSet
from rsibr.reconstruct.reconstruction import run
from rsibr.study.config import JudgeConfig
from rsibr.study.journal import Journal
from rsibr.study.lobes import lobe_errors, lobe_truth
from rsibr.study.noise import NoisyBake, noise_of, without
from rsibr.study.path_tracing import path_tracing_points
from rsibr.study.plan import BakeSize, Variant
from rsibr.study.results import (
    BakeRecord,
    ErrorRecord,
    PathTracingRecord,
    PointRecord,
    ReferenceRecord,
    Timing,
    label_of,
)
from rsibr.study.scene import Scene
from rsibr.study.truth import Arrays, TruthStore, reference_of
from rsibr.study.variants import bytes_read, opened_at, variant_of
from rsibr.validate.flip import Exposures, exposures_for
from rsibr.validate.metrics import compare, noise_floor
from rsibr.validate.reference import Reference

Images = list[NDArray[np.float32]]


@dataclass(eq=False)
class Bench:
    """What is measured in one scene, and where it is kept.

    Attributes
    ----------
    scene : Scene
    frames : sequence of ndarray, shape (3, 3)
        Judged views.
    judge : JudgeConfig
    journal : Journal
        Finished results.
    store : TruthStore
        References.
    bakes : Path
        Folder of the bakes.
    """

    scene: Scene
    frames: Sequence[NDArray[np.float64]]
    judge: JudgeConfig
    journal: Journal
    store: TruthStore
    bakes: Path
    _opened: BakedMaps | None = None

    def key(self, kind: str, **settings: Any) -> dict[str, Any]:
        """What a result depends on, beside its own settings."""
        judged = {"judged": [frame.tolist() for frame in self.frames], "reference_samples": self.judge.samples}
        return {"kind": kind, **self.scene.identity, **judged, "repeats": self.judge.repeats, **settings}

    @cached_property
    def references(self) -> list[Reference]:
        """Truth of each judged view."""
        return [self.reference(frame) for frame in self.frames]

    def reference(self, frame: NDArray[np.float64]) -> Reference:
        """Truth of one view."""
        return reference_of(self.scene, frame, self.judge.samples, self.store)

    def lobe_truth(self, frame: NDArray[np.float64]) -> Arrays:
        """Truth of each lobe in one view."""
        return lobe_truth(self.scene, frame, self.judge.samples, self.store)

    @cached_property
    def exposures(self) -> Exposures:
        """Exposures at which FLIP looks, from the mean radiance of all references."""
        covered = [reference.mean[reference.coverage > 0] for reference in self.references]
        return exposures_for(float(np.concatenate(covered).mean()))

    def reference_record(self) -> ReferenceRecord:
        """Sum the references up, one in memory at a time."""
        seconds, floors = [], []
        for frame in self.frames:
            reference = self.reference(frame)
            seconds.append(reference.seconds)
            floors.append(noise_floor(reference))
        return ReferenceRecord(
            samples=reference.samples,
            buffers=len(reference.buffers),
            sampler=reference.sampler,
            seconds=sum(seconds),
            noise_floor=float(np.mean(floors)),
        )

    def known_path_tracing(self, samples: Sequence[int], pass_samples: int | None) -> list[PathTracingRecord] | None:
        """Return what was measured of path tracing before."""
        known = self.journal.find(self.key("path-tracing", samples=list(samples), pass_samples=pass_samples))
        return None if known is None else [PathTracingRecord.model_validate_json(canonical(one)) for one in known]

    def path_tracing(self, samples: Sequence[int], pass_samples: int | None) -> None:
        """Measure path tracing with so many samples, in all and of a pass, and keep it in the journal."""
        found = path_tracing_points(
            self.scene.tracer,
            self.frames,
            self.references,
            self.exposures,
            samples,
            pass_samples=pass_samples,
            seed=self.scene.seed,
            runs=self.judge.repeats,
        )
        key = self.key("path-tracing", samples=list(samples), pass_samples=pass_samples)
        self.journal.store(key, [record.model_dump(mode="json") for record in found])

    def known_point(self, size: BakeSize, variant: Variant) -> PointRecord | None:
        """Return a point that was measured before."""
        known = self.journal.find(self.key("point", size=vars(size), variant=vars(variant)))
        return None if known is None else PointRecord.model_validate_json(canonical(known))

    def measure(self, size: BakeSize, variant: Variant) -> PointRecord:
        """Error and cost of a variant's pictures of all judged views, kept in the journal."""
        if self._opened is None or self._opened.size != size:
            self.bake(size)
        point = cast(BakedMaps, self._opened).measure(variant)
        self.journal.store(self.key("point", size=vars(size), variant=vars(variant)), point.model_dump(mode="json"))
        return point

    def bake(self, size: BakeSize) -> None:
        """Bake at a size, or go on with a bake that was killed, and open it; the one opened before is let go."""
        self.release()
        key = {"kind": "bake", **self.scene.content, "size": vars(size)}
        scene = re.sub(r"\W+", "-", f"{self.scene.material_name} {self.scene.environment_name}")
        path = self.bakes / f"{scene}-{checksum(canonical(key))[:12]}.rsibr"
        begun, config, start = path.exists(), size.config(self.scene.config), time.perf_counter()
        try:
            baked = bake(config, out=path)
        except BakeError:  # of an older version, or damaged: the name holds the hash of what it must be
            baked = bake(config, out=path, fresh=True)
        wall = time.perf_counter() - start
        known = self.journal.find(key)
        if known is None or not begun:
            known = _bake_record(baked, size, None if begun else wall).model_dump(mode="json")
            self.journal.store(key, known)
        self._opened = BakedMaps(self, baked, BakeRecord.model_validate_json(canonical(known)), size)

    def release(self) -> None:
        """Let the opened bake go, with its maps on the device."""
        self._opened = None

    def close(self) -> None:
        """Let go of all that memory holds of this scene; what is on disk stays."""
        self.release()
        self.__dict__.pop("references", None)


@dataclass(eq=False)
class BakedMaps:
    """One bake, opened for all pictures that are to be made of it.

    Attributes
    ----------
    bench : Bench
    bake : Bake
    record : BakeRecord
    size : BakeSize
    """

    bench: Bench
    bake: Bake
    record: BakeRecord
    size: BakeSize
    _methods: dict[str, MethodSet] = field(default_factory=dict)
    _noise: dict[Variant, float] = field(default_factory=dict)

    def measure(self, variant: Variant) -> PointRecord:
        """Error and cost of the pictures of all judged views."""
        bench, method = self.bench, variant_of(self._at(variant.precision), variant)
        images, seconds = self._timed(method)
        judged = zip(images, bench.references, strict=True)
        error = ErrorRecord.of([compare(image, truth, bench.exposures, name=str(variant)) for image, truth in judged])
        noise = self._noise_of(variant)
        return PointRecord(
            label=label_of(variant, self.record.views, self.record.resolution, self.record.samples),
            **vars(variant),
            bake=self.record,
            error=error,
            noise=noise,
            bias=without(error.rel_mse, noise),
            lobes=self._lobes(method) if isinstance(method, LobedMethod) and len(method.lobes) > 1 else None,
            frame_seconds=Timing.of(seconds),
            bytes=bytes_read(self.bake, method, variant.precision),
        )

    def _timed(self, method: Any) -> tuple[Images, list[float]]:
        """Picture of each judged view, and the times of its repeats; the first run, which compiles, does not count."""
        resolution, images, seconds = self.bench.scene.resolution, [], []
        for frame in self.bench.frames:
            images.append(run(method, frame, resolution).image)
            seconds += [run(method, frame, resolution).seconds for _ in range(self.bench.judge.repeats)]
        return images, seconds

    def _at(self, precision: str) -> MethodSet:
        if precision not in self._methods:
            opened = (
                NoisyBake(self.bake.path, self.bake.manifest, self.bench.scene.seed)
                if precision == "noisy"
                else opened_at(self.bake, precision)
            )
            self._methods[precision] = MethodSet(opened)
        return self._methods[precision]

    def _noise_of(self, variant: Variant) -> float:
        """Noise of the float32 maps in the pictures: that of rounding is no noise, but bias."""
        plain = Variant(variant.method, variant.warp, variant.weights, "float32")
        if plain not in self._noise:
            images, noisy = (
                [
                    run(variant_of(self._at(kind), plain), frame, self.bench.scene.resolution).image
                    for frame in self.bench.frames
                ]
                for kind in ("float32", "noisy")
            )
            self._noise[plain] = noise_of(images, noisy, self.bench.references)
        return self._noise[plain]

    def _lobes(self, method: LobedMethod) -> Any:
        bench = self.bench
        names = [record.name for record in self.bake.manifest.lobes]
        truths = [bench.lobe_truth(frame) for frame in bench.frames]
        return lobe_errors(method, names, bench.frames, truths, bench.references)


def _bake_record(baked: Bake, size: BakeSize, wall_seconds: float | None) -> BakeRecord:
    seconds = [float(state.seconds or 0.0) for state in baked.manifest.views]
    view = Timing.of(seconds)
    return BakeRecord(
        samples=size.samples,
        resolution=size.resolution,
        subdivision=size.subdivision,
        views=baked.view_count,
        seconds=view.times(baked.view_count),
        compile_seconds=max(0.0, seconds[0] - view.median),
        wall_seconds=wall_seconds,
        disk_bytes=baked.bytes,
    )
