"""One opened bake of a study: error and time of every variant of reconstruction."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.methods.device_size import device_bytes
from rsibr.methods.method_set import MethodSet
from rsibr.methods.protocol import Method
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import judged_by_lobe
from rsibr.store.bake import Bake
from rsibr.studies.agenda import BakeSize, Variant
from rsibr.studies.judged_scene import JudgedScene
from rsibr.studies.lobes import mean_lobe_errors
from rsibr.studies.noise import noise_of, noisy_maps, without
from rsibr.studies.results import BakeRecord, ErrorRecord, PointRecord, Timing, label_of, mean_model
from rsibr.studies.variants import opened_at, variant_of
from rsibr.validation.eval_error import judge_eval
from rsibr.validation.metrics import compare
from rsibr.validation.report.estimate_document import EstimateModel

Images = list[NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class TimedPictures:
    """Pictures of all judged views and their times.

    Attributes
    ----------
    images : list of ndarray, shape (N, N, 3)
        One picture a view.
    seconds : Timing
        Time of a picture, nothing compiled.
    compile_seconds : float
        Time of the very first picture beyond the others of its view [s].
    """

    images: Images
    seconds: Timing
    compile_seconds: float


@dataclass(eq=False)
class BakedMaps:
    """One opened bake, shared by all variants that are measured on it.

    Attributes
    ----------
    judged : JudgedScene
        Scene with the references.
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
        made = self._timed(method)
        on_device = max(method.cost.device_bytes, device_bytes(method))  # with the tables of this size of picture
        pairs = zip(made.images, judged.references, strict=True)
        error = ErrorRecord.of([compare(image, truth, judged.exposures, name=str(variant)) for image, truth in pairs])
        return PointRecord(
            label=label_of(variant, self.record.views, self.record.resolution, self.record.samples),
            **vars(variant),
            bake=self.record,
            error=error,
            **self._beside(variant, method, error),
            prepare_seconds=method.cost.prepare_seconds,
            compile_seconds=made.compile_seconds,
            frame_seconds=made.seconds,
            bytes=on_device,
        )

    def _beside(self, variant: Variant, method: Method, error: ErrorRecord) -> dict[str, Any]:
        """What is judged beside the pictures: noise, lobes, `eval`; None where only errors are asked for."""
        if self.judged.judge.errors_only:
            return dict.fromkeys(("noise", "bias", "lobes", "eval_rel_mse", "eval_seconds"))
        eval_rel_mse, eval_seconds = self._eval_of(method)
        noise = self._noise_of(variant)
        return {
            "noise": noise,
            "bias": without(error.rel_mse, noise),
            "lobes": self._lobes(variant) if self._has_parts(variant) else None,
            "eval_rel_mse": eval_rel_mse,
            "eval_seconds": eval_seconds,
        }

    def _timed(self, method: Method) -> TimedPictures:
        """Make the picture of each judged view once, and again for every timed repeat."""
        resolution, repeats = self.judged.scene.resolution, self.judged.judge.repeats
        images, seconds, compiled = Images(), list[float](), 0.0
        for frame in self.judged.frames:
            first = run(method, frame, resolution)
            again = [run(method, frame, resolution).seconds for _ in range(repeats)]
            if not images:
                compiled = max(0.0, first.seconds - median(again))
            images.append(first.image)
            seconds += again
        return TimedPictures(images, Timing.of(seconds), compiled)

    def _eval_of(self, method: Method) -> tuple[EstimateModel, Timing]:
        """Error of `eval`, mean over the judged views, and the time of one evaluation."""
        judged = self.judged
        found = [
            judge_eval(method, frame, truth, judged.scene.seed)
            for frame, truth in zip(judged.frames, judged.references, strict=True)
        ]
        return mean_model([one.rel_mse for one in found]), Timing.of([one.seconds for one in found])

    def _at(self, precision: str) -> MethodSet:
        if precision not in self._methods:
            opened = (
                noisy_maps(self.bake, self.judged.scene.seed)
                if precision == "noisy"
                else opened_at(self.bake, precision)
            )
            self._methods[precision] = MethodSet(opened)
            if precision == "noisy":  # with the belief of the bake itself: another belief is no noise of its pictures
                self._methods[precision].inputs.learnt = self._at("float32").inputs.learnt
        return self._methods[precision]

    def _noise_of(self, variant: Variant) -> float:
        """Noise of the float32 maps in the pictures. The rounding error of float16 counts as bias."""
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


def bake_record(baked: Bake, size: BakeSize) -> BakeRecord:
    """Cost of a bake.

    Parameters
    ----------
    baked : Bake
        A finished bake; `Bake.seconds` is its whole wall time.
    size : BakeSize
        What it was asked for.
    """
    seconds = [float(state.seconds or 0.0) for state in baked.manifest.views]
    views = Timing.of(seconds).times(baked.view_count)
    setup = max(0.0, baked.seconds - views.median)
    return BakeRecord(
        samples=size.samples,
        resolution=size.resolution,
        subdivision=size.subdivision,
        views=baked.view_count,
        seconds=views.plus(setup),
        views_seconds=views,
        setup_seconds=setup,
        compile_seconds=min(setup, max(0.0, seconds[0] - median(seconds))),
        disk_bytes=baked.bytes,
    )
