"""Shape of a lobe as a mixture of Gaussians over microfacet slopes.

GGX slopes follow a Student t distribution with two degrees of freedom, which is a scale mixture of Gaussians. A few
Gaussians, each twice as wide as the last, approximate any sum of GGX lobes, tails included; each one is a blur that the
environment pyramid provides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.fit import ProxyLobe

_RATIO = 2.0
_NARROWEST = 0.3  # σ over the least roughness; narrower Gaussians would carry almost no energy
_WIDEST = 1.0
_STEEPEST = 4.0
_FAINTEST = 1e-4


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Mixture of isotropic Gaussians over microfacet slopes.

    Attributes
    ----------
    sigmas : ndarray, shape (M,)
        Standard deviations, ascending.
    plain, grazing : ndarray, shape (M, 3)
        Weight of each in each channel, ≥ 0: without a Fresnel term, and times Schlick's (1 − cos θ)⁵.
    """

    sigmas: NDArray[np.float64]
    plain: NDArray[np.float64]
    grazing: NDArray[np.float64]

    def between(self, low: float, high: float) -> Gaussians:
        """Gaussians with low ≤ σ < high."""
        chosen = (self.sigmas >= low) & (self.sigmas < high)
        return Gaussians(self.sigmas[chosen], self.plain[chosen], self.grazing[chosen])


@dataclass(frozen=True, eq=False)
class LobeShape:
    """Shape of a lobe: the weight with which it integrates incident light.

    Attributes
    ----------
    alpha : float
        Roughness α in the masking-shadowing term.
    bare : Gaussians
        Microfacets on the surface.
    coated : Gaussians
        Microfacets under a coat (`rsibr.lobes.basis.coated_ggx`); their grazing weights are zero.
    matte : ndarray, shape (2, 3)
        Weights of a cosine lobe, bare and coated (`rsibr.lobes.basis.lambert`).
    """

    alpha: float
    bare: Gaussians
    coated: Gaussians
    matte: NDArray[np.float64]

    @property
    def is_matte(self) -> bool:
        """Whether the lobe follows the normal."""
        return bool(self.matte.any())

    @property
    def is_mirror(self) -> bool:
        """Whether the lobe is a delta distribution."""
        return not self.is_matte and not self.bare.sigmas.any() and not len(self.coated.sigmas)

    @classmethod
    def of(cls, proxy: ProxyLobe) -> LobeShape:
        """Shape of a fitted lobe. Glossy terms of a matte lobe, which are wide, count as Lambertian."""
        if proxy.is_matte:
            at = proxy.alphas.index(LAMBERT)
            return cls(LAMBERT, _NOTHING, _NOTHING, proxy.coefficients[at])
        terms = [np.concatenate([c, np.zeros((3 - len(c), 3))]) for c in proxy.coefficients]  # plain, grazing, coated
        plain, grazing, coated = np.stack(terms, axis=1)
        alphas = np.array(proxy.alphas)
        return cls(proxy.alpha, _mixture(alphas, plain, grazing), _mixture(alphas, coated), np.zeros((2, 3)))

    @classmethod
    def mirror(cls) -> LobeShape:
        """Shape of a delta lobe: all microfacets at slope zero."""
        one = np.ones((1, 3))
        return cls(0.0, Gaussians(np.zeros(1), one, 0 * one), _NOTHING, np.zeros((2, 3)))


_NOTHING = Gaussians(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


def _mixture(
    alphas: NDArray[np.float64], plain: NDArray[np.float64], grazing: NDArray[np.float64] | None = None
) -> Gaussians:
    """Fit Gaussians to Σ c_t p_t(s), p(s) = α²/(π(α² + s²)²), in least relative squares, tails included."""
    grazing = np.zeros_like(plain) if grazing is None else grazing
    used = (plain + grazing).any(axis=1)
    if not used.any():
        return _NOTHING
    alphas, plain, grazing = alphas[used], plain[used], grazing[used]
    # Dictionary of Gaussians, each _RATIO times as wide as the last, and the densities to fit at sampled slopes
    steps = int(np.ceil(np.log(_WIDEST / (_NARROWEST * alphas.min())) / np.log(_RATIO)))
    sigmas = _NARROWEST * alphas.min() * _RATIO ** np.arange(steps + 1)
    slope = np.geomspace(0.05 * alphas.min(), _STEEPEST, 300)[:, None]
    basis = np.exp(-0.5 * (slope / sigmas) ** 2) / (2 * np.pi * sigmas**2)
    density = alphas**2 / (np.pi * (alphas**2 + slope**2) ** 2)

    def fitted(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
        wanted = density @ coefficients
        return np.stack(
            [nnls(basis / y[:, None], np.ones(len(y)))[0] if y.any() else np.zeros(len(sigmas)) for y in wanted.T],
            axis=1,
        )

    # Least relative squares per channel; Gaussians with almost no energy are dropped
    weights, graze = fitted(plain), fitted(grazing)
    energy = weights.sum(axis=1) + graze.sum(axis=1)
    kept = energy > _FAINTEST * energy.sum()
    return Gaussians(sigmas[kept], weights[kept], graze[kept])
