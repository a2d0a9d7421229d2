"""Terms of the prediction: the Gaussians and matte parts of all lobes, with their shares of the albedo by angle.

A lobe k predicts P_k = E_k Σ_j (u_kj/Σ u_kj) Λ_kj: the directional albedo E_k of the true BRDF, shared out in
proportion to the energies u_kj of the terms of its shape, times the mean light Λ_kj over each term's kernel. Methods
differ only in how they gather Λ. Equation numbers are those of docs/method.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.facet_moments import FacetMoments, cosines, facet_moments, matte_energy
from rsibr.lobes.gaussians import LobeShape

Array = NDArray[np.float64]

Lobe = tuple[LobeShape, Array]
"""Shape of a lobe, and its directional albedo, shape (albedo nodes, 3)."""

WIDE = 0.1
"""Standard deviation of slopes from which a Gaussian is wide: its light varies slowly with the normal."""


@dataclass(frozen=True, eq=False)
class GaussianTerm:
    """One Gaussian of a lobe.

    Attributes
    ----------
    sigma : float
        Standard deviation of its slopes.
    alpha : float
        Roughness α of its masking.
    plain, grazing : ndarray, shape (3,)
        Its weights in the fit; see `rsibr.lobes.gaussians.Gaussians`.
    is_coated : bool
        Whether its microfacets lie under the coat.
    share : ndarray, shape (NODES, 3)
        Its share of the lobe's albedo at the nodes of `rsibr.lobes.facet_moments.cosines`.
    moments : FacetMoments
        What is seen of it at each angle.
    is_wide : bool
        Whether it is gathered by quadrature.
    """

    sigma: float
    alpha: float
    plain: Array
    grazing: Array
    is_coated: bool
    share: Array
    moments: FacetMoments
    is_wide: bool


@dataclass(frozen=True, eq=False)
class MatteTerm:
    """Matte part of a lobe: its weights (2, 3) as in `LobeShape.matte`, and its share of the albedo (NODES, 3)."""

    weights: Array
    share: Array


@dataclass(frozen=True, eq=False)
class LobeTerms:
    """All terms of a material's lobes, delta lobes excepted.

    Attributes
    ----------
    gaussians : list of GaussianTerm
    matte : list of MatteTerm
        At most one a lobe.
    """

    gaussians: list[GaussianTerm]
    matte: list[MatteTerm]

    @classmethod
    def of(cls, lobes: Sequence[Lobe], part: LobeShape | None = None, wide: float = WIDE) -> LobeTerms:
        """Make the terms of `lobes`.

        Parameters
        ----------
        lobes : sequence of (LobeShape, ndarray of shape (albedo nodes, 3))
            Shape and directional albedo of each lobe.
        part : LobeShape, optional
            All terms but those of this one shape have a share of zero.
        wide : float
            Standard deviation of slopes from which a Gaussian is wide.
        """
        gaussians, matte = list[GaussianTerm](), list[MatteTerm]()
        for shape, albedo in lobes:
            if shape.is_mirror:
                continue
            wanted = albedo_at_nodes(albedo) if part in (None, shape) else np.zeros((len(cosines()), 3))
            moments, flat = facet_moments(shape), matte_energy(shape.matte)
            energy = sum((one.weight for one in moments), start=flat)
            scale = wanted / np.maximum(energy, 1e-30)
            weighed = [(shape.bare, k, False) for k in range(len(shape.bare))]
            weighed += [(shape.coated, k, True) for k in range(len(shape.coated))]
            for (mixture, k, coated), seen in zip(weighed, moments, strict=True):
                plain, grazing = mixture.plain[k], mixture.grazing[k]
                share, sigma = seen.weight * scale, float(mixture.sigmas[k])
                gaussians.append(
                    GaussianTerm(sigma, shape.alpha, plain, grazing, coated, share, seen, is_wide=sigma >= wide)
                )
            if shape.has_matte:
                matte.append(MatteTerm(shape.matte, flat * scale))
        return cls(gaussians, matte)

    @classmethod
    def pair(cls, lobes: Sequence[Lobe], part: LobeShape | None, wide: float = WIDE) -> tuple[LobeTerms, LobeTerms]:
        """Terms of `lobes`, which make the kernels, and the same with the shares that count: of all, or of `part`."""
        terms = cls.of(lobes, wide=wide)
        return terms, terms if part is None else cls.of(lobes, part, wide)

    @property
    def narrow(self) -> list[GaussianTerm]:
        """Gaussians that are not wide."""
        return [term for term in self.gaussians if not term.is_wide]

    @property
    def wide(self) -> list[GaussianTerm]:
        """Gaussians that are gathered by quadrature."""
        return [term for term in self.gaussians if term.is_wide]


def albedo_at_nodes(albedo: Array) -> Array:
    """Resample a table of directional albedo (`rsibr.lobes.albedo`) to the nodes of the moments, shape (NODES, 3)."""
    return resampled(albedo, node_cosines(), cosines())


def resampled(table: Array, nodes: Array, wanted: Array) -> Array:
    """Values of a table (nodes, 3) at other cosines, linear in √cos θ, shape (wanted, 3)."""
    place = np.sqrt(wanted)
    return np.stack([np.interp(place, np.sqrt(nodes), channel) for channel in table.T], axis=1)
