"""Weights of the levels of a half-vector pyramid by surface angle, from the Gaussians of all lobes.

Equation numbers are those of docs/method.md, section 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.facet_moments import NODES, FacetMoments, cosines, facet_moments
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.rsibr.half_vector_pyramid import LEVELS, level_variances, texel_angle

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LobeWeights:
    """Weights at the nodes `rsibr.lobes.facet_moments.cosines`.

    Attributes
    ----------
    levels : ndarray, shape (LEVELS, NODES, 4)
        Weight g_ℓ of each level (RGB), and radius factor φ_ℓ in the half-vector map; see
        `half_vector_pyramid.gathered`.
    sharp : ndarray, shape (NODES, 4)
        Weight of the sharp part (RGB), the Gaussians narrower than level 0, and its standard deviation [rad].
    """

    levels: Array
    sharp: Array

    @property
    def has_sharp(self) -> bool:
        """Whether any Gaussian is narrower than level 0."""
        return bool(self.sharp[:, :3].any())


def albedo_at_nodes(albedo: Array) -> Array:
    """Resample a table of directional albedo (`rsibr.lobes.albedo`) to the nodes of the weights, shape (NODES, 3)."""
    place = np.sqrt(cosines())
    return np.stack([np.interp(place, np.sqrt(node_cosines()), channel) for channel in albedo.T], axis=1)


def lobe_weights(
    lobes: Sequence[tuple[LobeShape, Array]], resolution: int, part: LobeShape | None = None
) -> LobeWeights:
    """Distribute the Gaussians of glossy lobes over the levels of the pyramid.

    Parameters
    ----------
    lobes : sequence of (LobeShape, ndarray of shape (albedo nodes, 3))
        Shape and directional albedo of each lobe; at each angle the weights of its Gaussians add up to the albedo.
    resolution : int
        Texels a side of level 0.
    part : LobeShape, optional
        Return the weights of this one of `lobes` only, with the radius factors of all of them.

    Returns
    -------
    LobeWeights
        A Gaussian between two levels is mixed from both so that its variance is preserved (eq. 27); one narrower than
        level 0 is mixed from level 0 and the sharp part.
    """
    # ---- Accumulate weights, energy, lean and variance over the Gaussians of all lobes ----
    angle = np.arccos(cosines())
    spacing = texel_angle(resolution, angle)
    weights = np.zeros((LEVELS + 1, NODES, 3))
    energy, leans, variances = np.zeros((LEVELS + 1, NODES)), np.zeros((LEVELS + 1, NODES)), np.zeros(NODES)
    for shape, albedo in lobes:
        for moments, weight in _normalized(facet_moments(shape), albedo_at_nodes(albedo)):
            shares = _shares((moments.width / spacing) ** 2)
            weights += shares[..., None] * (weight if part in (None, shape) else 0)
            carried = shares * weight.sum(axis=1)
            energy += carried
            leans += carried * moments.lean
            variances += carried[-1] * moments.width**2
    # ---- Radius factors from the mean lean of each level (eq. 28), width of the sharp part ----
    energy = np.maximum(energy, 1e-30)
    factors = _radius_factors(angle, leans / energy)
    levels = np.concatenate([weights, factors[..., None]], axis=-1)[:LEVELS]
    sharp = np.concatenate([weights[-1], np.sqrt(variances / energy[-1])[:, None]], axis=-1)
    return LobeWeights(levels, sharp)


def _normalized(moments: list[FacetMoments], albedo: Array) -> list[tuple[FacetMoments, Array]]:
    """Scale the energies of a lobe's Gaussians so that they add up to its albedo."""
    total = np.maximum(sum((m.weight for m in moments), start=np.zeros((NODES, 3))), 1e-30)
    return [(m, m.weight / total * albedo) for m in moments]


def _shares(variance: Array) -> Array:
    """Share of each level, then of the sharp part, in a Gaussian; eq. 27. `variance` is in texels² of level 0.

    Shape (LEVELS + 1, NODES).
    """
    steps = level_variances()
    shares = np.zeros((LEVELS + 1, len(variance)))
    node = np.arange(len(variance))
    below = np.clip(np.searchsorted(steps, variance) - 1, 0, LEVELS - 2)
    upper = np.clip((variance - steps[below]) / (steps[below + 1] - steps[below]), 0, 1)
    narrow = variance < steps[0]
    first = np.where(narrow, np.clip(variance / steps[0], 0, 1), 1 - upper)
    shares[below, node] = first
    shares[below + 1, node] += np.where(narrow, 0, upper)
    shares[-1] = np.where(narrow, 1 - first, 0)
    return shares


def _radius_factors(angle: Array, lean: Array) -> Array:
    """Radius factor φ: radius in the half-vector map of the leaning lobe's centre over that of the normal; eq. 28."""
    leaning = np.tan(np.clip(angle - lean, 0, np.pi / 2) / 2)
    upright = np.tan(angle / 2)
    return np.where(upright > 1e-6, leaning / np.maximum(upright, 1e-6), 1.0)
