"""One bake, opened: every picture that a study makes of it, timed and judged."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import judged_by_lobe
from rsibr.store.bake import Bake
from rsibr.studies.agenda import BakeSize, Variant
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.lobes import mean_lobe_errors
from rsibr.studies.noise import noise_of, noisy_maps, without
from rsibr.studies.results import BakeRecord, ErrorRecord, PointRecord, Timing, label_of
from rsibr.studies.variants import bytes_read, opened_at, variant_of
from rsibr.validation.metrics import compare
from rsibr.validation.report.estimate_document import EstimateModel

Images = list[NDArray[np.float32]]


@dataclass(eq=False)
class BakedMaps:
    """One bake, opened for all pictures that are to be made of it.

    Attributes
    ----------
    judged : JudgedScene
        What the pictures are compared with.
    bake : Bake
    record : BakeRecord
    size : BakeSize
    """

    judged: JudgedScene
    bake: Bake
    record: BakeRecord
    size: BakeSize
    _methods: dict[str, MethodSet] = field(default_factory=dict)
    _noise: dict[Variant, float] = field(default_factory=dict)

    def measure(self, variant: Variant) -> PointRecord:
        """Error and cost of the pictures of all judged views."""
        judged, method = self.judged, variant_of(self._at(variant.precision), variant)
        images, seconds = self._timed(method)
        pairs = zip(images, judged.references, strict=True)
        error = ErrorRecord.of([compare(image, truth, judged.exposures, name=str(variant)) for image, truth in pairs])
        noise = self._noise_of(variant)
        return PointRecord(
            label=label_of(variant, self.record.views, self.record.resolution, self.record.samples),
            **vars(variant),
            bake=self.record,
            error=error,
            noise=noise,
            bias=without(error.rel_mse, noise),
            lobes=self._lobes(variant) if self._has_parts(variant) else None,
            frame_seconds=Timing.of(seconds),
            bytes=bytes_read(self.bake, variant.method, variant.precision),
        )

    def _timed(self, method: Any) -> tuple[Images, list[float]]:
        """Picture of each judged view, and the times of its repeats; the first run, which compiles, does not count."""
        resolution, images, seconds = self.judged.scene.resolution, [], []
        for frame in self.judged.frames:
            images.append(run(method, frame, resolution).image)
            seconds += [run(method, frame, resolution).seconds for _ in range(self.judged.judge.repeats)]
        return images, seconds

    def _at(self, precision: str) -> MethodSet:
        if precision not in self._methods:
            opened = (
                noisy_maps(self.bake, self.judged.scene.seed)
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
                    run(variant_of(self._at(kind), plain), frame, self.judged.scene.resolution).image
                    for frame in self.judged.frames
                ]
                for kind in ("float32", "noisy")
            )
            self._noise[plain] = noise_of(images, noisy, self.judged.references)
        return self._noise[plain]

    def _has_parts(self, variant: Variant) -> bool:
        return judged_by_lobe(variant.method) and len(self.bake.manifest.lobes) > 1

    def _lobes(self, variant: Variant) -> dict[str, EstimateModel]:
        judged, methods = self.judged, self._at(variant.precision)
        names = [lobe.name for lobe in self.bake.manifest.lobes]
        parts = {name: methods.variant(variant.method, lobe=name) for name in names}
        truths = [judged.lobe_truth(frame) for frame in judged.frames]
        return mean_lobe_errors(parts, judged.frames, truths, judged.references)


def bake_record(baked: Bake, size: BakeSize, wall_seconds: float | None) -> BakeRecord:
    """Say what a bake cost: every view with the time of the median view, the first one's compiling apart."""
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
