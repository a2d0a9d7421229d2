"""The shape of a lobe as a mixture of Gaussians over the slopes of its facets: what a light can be blurred with.

The slopes of GGX facets follow Student's t with two degrees of freedom, which is a scale mixture of Gaussians. A few of
them, each twice as wide as the last, stand for any sum of GGX lobes, tails included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.fit import ProxyLobe

_RATIO = 2.0
_NARROWEST = 0.3  # of the least roughness: its Gaussian carries next to nothing
_WIDEST = 1.0
_STEEPEST = 4.0
_FAINTEST = 1e-4


@dataclass(frozen=True, eq=False)
class Gaussians:
    """A mixture of isotropic Gaussians over facet slopes.

    Attributes
    ----------
    sigmas : ndarray, shape (M,)
        Standard deviations, ascending.
    plain, grazing : ndarray, shape (M, 3)
        Weight of each in each channel, ≥ 0: without a Fresnel term, and times Schlick's (1 − cos)⁵.
    """

    sigmas: NDArray[np.float64]
    plain: NDArray[np.float64]
    grazing: NDArray[np.float64]

    def between(self, low: float, high: float) -> Gaussians:
        """Those with low ≤ σ < high."""
        chosen = (self.sigmas >= low) & (self.sigmas < high)
        return Gaussians(self.sigmas[chosen], self.plain[chosen], self.grazing[chosen])


@dataclass(frozen=True, eq=False)
class LobeShape:
    """How a lobe gathers its light.

    Attributes
    ----------
    alpha : float
        Roughness that masking and shadowing go by.
    bare : Gaussians
        Facets on the surface.
    coated : Gaussians
        Facets under a coat (`proxy.coated_ggx`); their grazing weights are zero.
    matte : ndarray, shape (2, 3)
        Weights of a cosine lobe, bare and coated (`proxy.lambert`).
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
        """Make the kernel of a fitted lobe. A matte lobe's glossy companions, far wider than most, count as matte."""
        if proxy.is_matte:
            at = proxy.alphas.index(LAMBERT)
            return cls(LAMBERT, _NOTHING, _NOTHING, proxy.coefficients[at])
        terms = [np.concatenate([c, np.zeros((3 - len(c), 3))]) for c in proxy.coefficients]  # plain, grazing, coated
        plain, grazing, coated = np.stack(terms, axis=1)
        alphas = np.array(proxy.alphas)
        return cls(proxy.alpha, _mixture(alphas, plain, grazing), _mixture(alphas, coated), np.zeros((2, 3)))

    @classmethod
    def mirror(cls) -> LobeShape:
        """Make the kernel of a delta lobe: facets without any slope."""
        one = np.ones((1, 3))
        return cls(0.0, Gaussians(np.zeros(1), one, 0 * one), _NOTHING, np.zeros((2, 3)))


_NOTHING = Gaussians(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


def _mixture(
    alphas: NDArray[np.float64], plain: NDArray[np.float64], grazing: NDArray[np.float64] | None = None
) -> Gaussians:
    """Fit Gaussians to Σ c_t p_t(s), p(s) = α²/(π(α² + s²)²), with even relative error down the tails."""
    grazing = np.zeros_like(plain) if grazing is None else grazing
    used = (plain + grazing).any(axis=1)
    if not used.any():
        return _NOTHING
    alphas, plain, grazing = alphas[used], plain[used], grazing[used]
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

    weights, graze = fitted(plain), fitted(grazing)
    energy = weights.sum(axis=1) + graze.sum(axis=1)
    kept = energy > _FAINTEST * energy.sum()
    return Gaussians(sigmas[kept], weights[kept], graze[kept])
