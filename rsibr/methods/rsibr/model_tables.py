"""Tables of a material's model for whole maps, on the host; `HalfVectorLobes` and the page are filled from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.lobe_terms import Lobe, LobeTerms, MatteTerm
from rsibr.methods.rsibr.delta_lobe import mirror_albedo
from rsibr.methods.rsibr.fidelity import Fidelity
from rsibr.methods.rsibr.lobe_weights import lobe_weights
from rsibr.methods.rsibr.narrow_gaussians import FootprintTables
from rsibr.methods.rsibr.wide_light import WideTables

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SizedTables:
    """Tables for maps of one size.

    Attributes
    ----------
    levels : ndarray, shape (LEVELS, NODES, 4), or None
        Weights and radius factors of the half-vector pyramid's levels, by cos θ; None where no Gaussian needs them.
    all_levels : ndarray, shape (LEVELS, NODES, 4)
        The same of all lobes, which the balance is made of, so that the parts of all lobes add up.
    sharp : FootprintTables or None
        Gaussians narrower than level 0.
    """

    levels: Array | None
    all_levels: Array
    sharp: FootprintTables | None


@dataclass(frozen=True, eq=False)
class ModelTables:
    """Tables of a material.

    Attributes
    ----------
    terms, parts : LobeTerms
        Terms of all lobes, and the same with the shares that count: of all lobes, or of one.
    wide : WideTables or None
        Quadrature over wide Gaussians.
    mirror : ndarray, shape (NODES, 3), or None
        Albedo of a delta lobe by cos θ.
    fidelity : Fidelity
        How finely the light is gathered.
    """

    terms: LobeTerms
    parts: LobeTerms
    wide: WideTables | None
    mirror: Array | None
    fidelity: Fidelity

    @classmethod
    def of(cls, lobes: Sequence[Lobe], part: LobeShape | None, fidelity: Fidelity) -> ModelTables:
        """Make the tables of `lobes`, of which one `part` may be all that counts."""
        terms, parts = LobeTerms.pair(lobes, part)
        wide = WideTables.of(terms.gaussians, parts.gaussians, fidelity.resolution, fidelity.points)
        return cls(terms, parts, wide, mirror_albedo(lobes, part), fidelity)

    @property
    def matte(self) -> list[MatteTerm]:
        """Matte parts that have a share."""
        return [term for term in self.parts.matte if term.share.any()]

    def for_maps(self, resolution: int) -> SizedTables:
        """Tables for maps of so many texels a side."""
        finest, fidelity = self.fidelity.resolution, self.fidelity
        texel = (2 / resolution) ** 2 / 12  # of a box filter, where the texel faces the viewer
        weights, whole = (
            lobe_weights(self.terms.narrow, counted, finest, texel, fidelity.texels)
            for counted in (self.parts.narrow, self.terms.narrow)
        )
        sharp = FootprintTables.of(self.terms.narrow, self.parts.narrow, whole.sharp, ratio=fidelity.ratio)
        return SizedTables(weights.levels if whole.has_levels else None, whole.levels, sharp)
