"""Weights of the levels of a half-vector pyramid by surface angle, from the narrow Gaussians of all lobes.

Equation numbers are those of docs/method.md, section 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.facet_moments import NODES, cosines
from rsibr.methods.lobe_terms import GaussianTerm
from rsibr.methods.rsibr.half_vector_pyramid import LADDER, level_variances, texel_angle

Array = NDArray[np.float64]

LEVELS = len(LADDER)

_SHARP = 0.8, 1.0  # variance over the least at which a Gaussian begins to pass, and has passed, to the levels


@dataclass(frozen=True, eq=False)
class LobeWeights:
    """Weights at the nodes `rsibr.lobes.facet_moments.cosines`.

    Attributes
    ----------
    levels : ndarray, shape (LEVELS, NODES, 4)
        Weight g_ℓ of each level (RGB), and radius factor φ_ℓ in the half-vector map; see
        `half_vector_pyramid.HalfVectorPyramid.collapsed`.
    sharp : ndarray, shape (Gaussians, NODES)
        Fraction of each Gaussian that is narrower than level 0.
    """

    levels: Array
    sharp: Array

    @property
    def has_levels(self) -> bool:
        """Whether any Gaussian is as wide as a level."""
        return bool(self.levels[..., :3].any())


def lobe_weights(
    terms: Sequence[GaussianTerm],
    parts: Sequence[GaussianTerm],
    resolution: int,
    texel: float = 0.0,
    least: float = 0.0,
) -> LobeWeights:
    """Distribute narrow Gaussians over the levels of the pyramid.

    Parameters
    ----------
    terms : sequence of GaussianTerm
        Narrow Gaussians of all lobes: they make the radius factors.
    parts : sequence of GaussianTerm
        The same in the same order, with the shares that count: of all lobes, or of one.
    resolution : int
        Texels a side of level 0.
    texel : float
        Variance of the normal over a texel of the map [rad²], which widens every Gaussian.
    least : float
        Least variance of a Gaussian in the levels, over `texel`.

    Returns
    -------
    LobeWeights
        A Gaussian is mixed of the three levels nearest to it, its variance preserved (eq. 27); one narrower than level
        0, or than `least`, belongs to the sharp part.
    """
    angle = np.arccos(cosines())
    spacing = texel_angle(resolution, angle)
    weights, sharp = np.zeros((LEVELS, NODES, 3)), np.zeros((len(terms), NODES))
    energy, leans = np.zeros((LEVELS, NODES)), np.zeros((LEVELS, NODES))
    for term, part, fraction in zip(terms, parts, sharp, strict=True):
        own = term.moments.width**2
        passed = _passed(own / (least * texel)) if least * texel > 0 else 1.0
        shares, fraction[:] = _shares((own + texel) / spacing**2, passed)
        weights += shares[..., None] * part.share
        carried = np.abs(shares) * term.share.sum(axis=1)
        energy += carried
        leans += carried * term.moments.lean
    factors = _radius_factors(angle, leans / np.maximum(energy, 1e-30))  # from the mean lean of each level (eq. 28)
    return LobeWeights(np.concatenate([weights, factors[..., None]], axis=-1), sharp)


def _passed(ratio: Array) -> Array:
    """Fraction of a Gaussian that belongs to the levels, by its variance over the least that they serve."""
    low, high = _SHARP
    return np.clip((ratio - low) / (high - low), 0, 1)


def _shares(variance: Array, passed: Array | float = 1.0) -> tuple[Array, Array]:
    """Share of each level in a Gaussian, shape (LEVELS, NODES), and fraction that is sharper; eq. 27.

    `variance` is in texels² of level 0, `passed` the fraction that may belong to the levels.
    """
    steps = level_variances()
    blurred = passed * _passed(variance / steps[0])
    return blurred * _mixture(np.clip(variance, steps[0], steps[-1]), steps), 1 - blurred


def _mixture(variance: Array, steps: Array) -> Array:
    """Weights of the three levels nearest to a Gaussian whose sum is nearest to it; shape (LEVELS, n); eq. 27.

    Least squares over the plane, with the sum of the weights and the variance kept. The mean of the product of two
    Gaussians of variances a and b is 1/(2π (a + b)). Two levels alone would make the middle too high by an eighth.
    """
    first = np.clip(np.searchsorted(steps, variance / np.sqrt(2)) - 1, 0, LEVELS - 3)
    members = first[:, None] + np.arange(3)
    scaled = steps[members] / variance[:, None]  # (n, 3)
    system = np.zeros((len(variance), 5, 5))
    system[:, :3, :3] = 1 / (scaled[:, :, None] + scaled[:, None, :])
    system[:, 3, :3] = system[:, :3, 3] = 1
    system[:, 4, :3] = system[:, :3, 4] = scaled
    right = np.concatenate([1 / (1 + scaled), np.ones((len(variance), 2))], axis=1)
    weights = np.zeros((len(variance), LEVELS))
    np.put_along_axis(weights, members, np.linalg.solve(system, right[..., None])[:, :3, 0], axis=1)
    return weights.T


def _radius_factors(angle: Array, lean: Array) -> Array:
    """Radius factor φ: radius in the half-vector map of the leaning lobe's centre over that of the normal; eq. 28."""
    leaning = np.tan(np.clip(angle - lean, 0, np.pi / 2) / 2)
    upright = np.tan(angle / 2)
    return np.where(upright > 1e-6, leaning / np.maximum(upright, 1e-6), 1.0)
