"""Shape of a lobe as a mixture of Gaussians over microfacet slopes.

Any isotropic distribution of slopes that falls with the slope is close to a scale mixture of Gaussians: a Beckmann lobe
is one of them, GGX (Student's t with two degrees of freedom) an exact mixture of infinitely many. Each Gaussian is a
blur of the environment that the methods can gather.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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

    sigmas: Array
    plain: Array
    grazing: Array

    @classmethod
    def none(cls) -> Gaussians:
        """No Gaussian at all."""
        return cls(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))

    def __len__(self) -> int:
        return len(self.sigmas)

    def between(self, low: float, high: float) -> Gaussians:
        """Gaussians with low ≤ σ < high."""
        chosen = (self.sigmas >= low) & (self.sigmas < high)
        return Gaussians(self.sigmas[chosen], self.plain[chosen], self.grazing[chosen])

    def tinted(self, colour: Array) -> Gaussians:
        """Return the mixture with its weights multiplied by a colour, shape (3,)."""
        return Gaussians(self.sigmas, self.plain * colour, self.grazing * colour)


@dataclass(frozen=True, eq=False)
class LobeShape:
    """Shape of a lobe: the BRDF as a sum of terms that can be gathered.

    Attributes
    ----------
    alpha : float
        Roughness α in the masking-shadowing term of all Gaussians.
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
    matte: Array

    @property
    def has_matte(self) -> bool:
        """Whether a part of the lobe follows the normal."""
        return bool(self.matte.any())

    @property
    def has_gaussians(self) -> bool:
        """Whether a part of the lobe is glossy, delta lobes excepted."""
        return bool(self.bare.sigmas.any()) or len(self.coated) > 0

    @property
    def is_mirror(self) -> bool:
        """Whether the lobe is a delta distribution."""
        return len(self.bare) == 1 and not self.bare.sigmas.any()

    @classmethod
    def mirror(cls) -> LobeShape:
        """Shape of a delta lobe: all microfacets at slope zero."""
        one = np.ones((1, 3))
        return cls(0.0, Gaussians(np.zeros(1), one, 0 * one), Gaussians.none(), np.zeros((2, 3)))

    def tinted(self, colour: Array) -> LobeShape:
        """Return the shape with all weights multiplied by a colour, shape (3,)."""
        return LobeShape(self.alpha, self.bare.tinted(colour), self.coated.tinted(colour), self.matte * colour)
