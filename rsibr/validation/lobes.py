"""Error of each lobe's part in a reconstruction by `rsibr`, against a lobe-resolved reference."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.baking.scene import Scene
from rsibr.errors import BakeError, InputError
from rsibr.methods.method_set import MethodSet
from rsibr.methods.protocol import Method
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import default_method, judged_by_lobe
from rsibr.planning.lobe_titles import lobe_titles
from rsibr.store.bake import Bake
from rsibr.store.noise import COVERED, denominator
from rsibr.validation.estimate import Estimate, jackknife, mean_estimate
from rsibr.validation.lobe_reference import LobeReference

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LobeError:
    """Error of one lobe at one view.

    Attributes
    ----------
    reference, image : ndarray, shape (H, W, 3)
        Radiance of the lobe in the reference, and its part in the reconstruction from the views that store the lobe
        separately; black if the plan left the lobe out of the bake.
    rel_mse : Estimate
        Mean of (a_k − b_k)²/(b² + ε) over texels and channels: squared error of the lobe over the denominator of the
        whole map's relMSE, with the noise of the reference subtracted. The values of all lobes need not add up to that
        of the whole map, because errors of two lobes may cancel.
    light : float
        Share of the lobe in the radiance of the map.
    relative_error : ndarray, shape (H, W)
        Square root of the relative squared error of each texel, mean over channels; NaN where coverage < ½.
    title : str
        What the lobe is, see `rsibr.planning.lobe_titles`.
    """

    reference: NDArray[np.float32]
    image: NDArray[np.float32]
    rel_mse: Estimate
    light: float
    relative_error: NDArray[np.float32]
    title: str


@dataclass(frozen=True, eq=False)
class ViewLobes:
    """Errors of all lobes at one view.

    Attributes
    ----------
    errors : dict of str to LobeError
        Error by name of the lobe.
    samples, buffers : int
        Samples a texel of the reference, and number of independent buffers.
    seconds : float
        Time of the reference, including compilation [s].
    """

    errors: dict[str, LobeError]
    samples: int
    buffers: int
    seconds: float

    @property
    def worst(self) -> str:
        """Name of the lobe with the largest error."""
        return max(self.errors, key=lambda name: self.errors[name].rel_mse.value)


@dataclass(frozen=True)
class LobeSummary:
    """Errors of one lobe over all views.

    Attributes
    ----------
    rel_mse : Estimate
        Mean over the views.
    rel_mse_range : tuple of two floats
        Minimum and maximum over the views.
    light : float
        Mean share of the radiance.
    worst_views : int
        Number of views at which this lobe has the largest error.
    title : str
        What the lobe is.
    """

    rel_mse: Estimate
    rel_mse_range: tuple[float, float]
    light: float
    worst_views: int
    title: str


class LobeJudge:
    """Measure the errors of the lobes of one bake at any view; methods and integrator are shared by all views.

    Parameters
    ----------
    bake : Bake
        Bake that stores its lobes separately.
    scene : Scene
        Scene of the bake.
    methods : MethodSet
        Methods of the bake.
    samples, buffers : int
        Minimum samples a texel of each reference, and number of independent buffers.

    Raises
    ------
    BakeError
        If the lobes of the bake differ from those into which this version splits the material.
    """

    def __init__(
        self,
        bake: Bake,
        scene: Scene,
        methods: MethodSet,
        samples: int,
        buffers: int,
    ) -> None:
        split = scene.parts.split
        stored = [record.name for record in bake.manifest.lobes]
        if {*stored, *_left_out(bake)} != set(split.names):
            raise BakeError(
                f"its lobes ({', '.join(stored)}) are not those of this version of rsibr ({', '.join(split.names)})",
                where=str(bake.path),
                fix="bake it again, or leave the lobes out (--no-lobes)",
            )
        integrator = scene.parts.integrator(bake.resolution, bake.rendering)
        self._reference = LobeReference(integrator, samples=samples, buffers=buffers, seed=scene.config.sampling.seed)
        self._parts = {
            name: methods.variant(default_method(), lobe=name) if name in stored else None for name in split.names
        }
        self._titles = lobe_titles(split.lobes)
        self._resolution = bake.resolution

    def at(self, frame: NDArray[np.float64]) -> ViewLobes:
        """Reconstruct each lobe at the view of `frame`, columns x, y, v, and compare it with its reference."""
        start = time.perf_counter()
        buffers = self._reference.buffers(frame)
        seconds = time.perf_counter() - start
        errors = self._errors([self._image(part, frame) for part in self._parts.values()], buffers)
        return ViewLobes(errors, self._reference.samples, len(buffers), seconds)

    def _image(self, part: Method | None, frame: NDArray[np.float64]) -> NDArray[np.float32]:
        if part is None:
            return np.zeros((self._resolution, self._resolution, 3), dtype=np.float32)
        return run(part, frame, self._resolution).image

    def _errors(self, images: list[NDArray[np.float32]], buffers: NDArray[np.float32]) -> dict[str, LobeError]:
        """Errors of the lobes, from their reconstructions and reference buffers (K, covered texels, lobes, 3)."""
        # ---- Debiased squared errors over the denominator of the whole map ----
        coverage = self._reference.coverage
        covered, judged = coverage > 0, coverage >= COVERED
        kept = judged[covered]
        parts, mean = np.stack([image[judged] for image in images], axis=1), buffers.mean(axis=0, dtype=np.float64)
        estimates = lobe_errors(parts, buffers[:, kept])
        whole = denominator(mean[kept].sum(axis=1))
        squared = ((parts - mean[kept]) ** 2 / whole[:, None]).mean(axis=-1)
        light = (coverage[covered, None] * mean.sum(axis=-1)).sum(axis=0)
        # ---- Images, share of the radiance, and error image of each lobe ----
        found = {}
        for k, name in enumerate(self._parts):
            picture = np.full(coverage.shape, np.nan, dtype=np.float32)
            picture[judged] = np.sqrt(squared[:, k])
            reference = self._reference.image(mean[:, k].astype(np.float32))
            share = float(light[k] / light.sum()) if light.sum() > 0 else 0.0
            found[name] = LobeError(reference, images[k], estimates[k], share, picture, self._titles[name])
        return found


def has_lobes(bake: Bake, methods: Sequence[str], wanted: bool | None) -> bool:
    """Whether to measure the errors of single lobes of a bake.

    Parameters
    ----------
    bake : Bake
        The bake.
    methods : sequence of str
        Methods of the validation.
    wanted : bool or None
        Choice of the user; None: if a method is `judged_by_lobe` and there is more than one lobe.

    Raises
    ------
    InputError
        If the user wants it, and the bake has fewer than two separate lobes.
    """
    count = len(bake.manifest.lobes) and len(bake.manifest.lobes) + len(_left_out(bake))
    if wanted and count < 2:
        what = "only one lobe" if count else "no lobes kept apart"
        raise InputError(f"{bake.path} has {what}", where="lobes", fix="leave it out")
    return any(map(judged_by_lobe, methods)) and count > 1 if wanted is None else wanted


def _left_out(bake: Bake) -> Sequence[str]:
    """Lobes that the plan of the bake left out."""
    return bake.manifest.plan.left_out if bake.manifest.plan else ()


def lobe_errors(parts: NDArray[np.floating], buffers: NDArray[np.floating]) -> list[Estimate]:
    """Debiased squared error of each lobe over the denominator of the whole map's relMSE.

    Parameters
    ----------
    parts : ndarray, shape (T, L, 3)
        Reconstructed radiance of each lobe at texels with coverage ≥ ½.
    buffers : ndarray, shape (K, T, L, 3)
        Independent references of the same.

    Returns
    -------
    list of Estimate
        One for each lobe, with intervals by the jackknife over the buffers.
    """

    def means(buffers: Array) -> Array:
        mean, variance = buffers.mean(axis=0), buffers.var(axis=0, ddof=1) / len(buffers)
        whole = denominator(mean.sum(axis=1))[:, None]
        return np.asarray((((parts - mean) ** 2 - variance) / whole).mean(axis=(0, 2)))

    exact = buffers.astype(np.float64)
    values = means(exact)
    left_out = np.array([means(np.delete(exact, k, axis=0)) for k in range(len(exact))])
    return [jackknife(float(value), left_out[:, k]) for k, value in enumerate(values)]


def summarise(views: Sequence[ViewLobes]) -> dict[str, LobeSummary]:
    """Summarise each lobe over all views, in the order of the bake."""

    def summary(name: str) -> LobeSummary:
        errors = [view.errors[name] for view in views]
        values = [error.rel_mse.value for error in errors]
        return LobeSummary(
            rel_mse=mean_estimate([error.rel_mse for error in errors]),
            rel_mse_range=(min(values), max(values)),
            light=float(np.mean([error.light for error in errors])),
            worst_views=sum(view.worst == name for view in views),
            title=errors[0].title,
        )

    return {name: summary(name) for name in views[0].errors}
