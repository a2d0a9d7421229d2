"""Splits the error of a picture into the noise of the stored maps and the bias of the method."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rsibr.store.described_maps import AlteredMaps
from rsibr.store.map_file import MapFile
from rsibr.store.noise import COVERED, denominator
from rsibr.store.stored_maps import StoredMaps
from rsibr.validation.reference import Reference
from rsibr.validation.report.estimate_document import EstimateModel

_NOISE_BRANCH = 0x6E6F_6973
"""Branch of the seed tree (the letters "nois")."""


def noisy_maps(bake: StoredMaps, seed: int) -> AlteredMaps:
    """A bake with its noise doubled in variance: independent Gaussians of the stored variance are added to its maps.

    The difference of a picture made of it and one made of the bake itself is the noise that the picture has: exactly so
    where a method is linear in the maps, to first order where not, whatever it warps, blends and divides. The variance
    is stored for the sum of the lobes; it is shared out among them in proportion to their radiance, as of independent
    lobes, so that their sum has the variance that was stored.

    Parameters
    ----------
    bake : StoredMaps
    seed : int
        Root of the seed tree.
    """

    def noisy(index: int, stored: MapFile) -> MapFile:
        generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_NOISE_BRANCH, index)))
        variance = np.zeros_like(stored.radiance) if stored.variance is None else stored.variance
        whole = np.sum([np.abs(image) for image in stored.layers.values()], axis=0)
        layers = {}
        for name, image in stored.layers.items():
            even = np.float32(1 / len(stored.layers))
            share = np.divide(np.abs(image), whole, out=np.full_like(image, even), where=whole > 0)
            noise = np.sqrt(variance * share) * generator.standard_normal(image.shape, dtype=np.float32)
            layers[name] = np.asarray(image + noise, dtype=np.float32)
        return replace(stored, layers=layers)

    return AlteredMaps.of(bake, noisy)


def noise_of(
    pictures: Iterable[NDArray[np.float32]], noisy: Iterable[NDArray[np.float32]], references: Iterable[Reference]
) -> float:
    """Contribution of the noise of the maps to relMSE, mean over the views.

    Parameters
    ----------
    pictures, noisy : iterable of ndarray, shape (H, W, 3)
        The same views from a bake and from its `noisy_maps`.
    references : iterable of Reference
        What the noise is relative to.
    """
    views = [
        relative_square(noise - picture, reference)
        for picture, noise, reference in zip(pictures, noisy, references, strict=True)
    ]
    return float(np.mean(views))


def relative_square(difference: NDArray[np.floating], reference: Reference) -> float:
    """Mean over texels and channels of a squared difference, divided as in relMSE."""
    judged = reference.coverage >= COVERED
    b = reference.buffers[:, judged].mean(axis=0, dtype=np.float64)
    return float(np.mean(difference[judged].astype(np.float64) ** 2 / denominator(b)))


def without(total: EstimateModel, noise: float) -> EstimateModel:
    """Subtract the predicted noise from a relMSE and its interval, which comes from the noise of the reference."""
    low, high = (bound - noise for bound in total.ci95)
    return EstimateModel(value=total.value - noise, ci95=(low, high), below_noise_floor=low <= 0)
