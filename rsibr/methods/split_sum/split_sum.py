"""`split-sum`: image-based lighting of real-time engines, a prefiltered cube times an albedo from two terms."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.light.harmonic_irradiance import HarmonicIrradiance, light_coefficients
from rsibr.lobes.albedo import NODES
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.options import choice, flag, whole
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.shading_method import MOST_POINTS, POINTS, ShadingMethod
from rsibr.methods.split_sum.delta_highlights import DeltaHighlights
from rsibr.methods.split_sum.material_fit import fit_lobe, mean_error
from rsibr.methods.split_sum.multiple_scattering import multiple_scattering
from rsibr.methods.split_sum.prefiltered_cube import SHARP, PrefilteredCube, Sources, mip_chain
from rsibr.methods.split_sum.split_shading import GlossyLobe, SplitShading

Albedo = Literal["dfg", "exact"]
"""Factor of a glossy lobe: F₀ A + F₉₀ B, or the lobe's own directional albedo."""

LEAST_SIZE, MOST_SIZE = 4, 1024
"""Limits of the option `size` [texels]."""

_FAINT, _BLURRED = 1e-3, 0.3  # share of the brightest lobe below which one of at least such a roughness gets no cube


class SplitSum(ShadingMethod):
    """Split sum: ∫ f L cos θ dω ≈ E(n·v) · (prefiltered environment in the mirror direction), for each glossy lobe.

    Parameters
    ----------
    inputs : MethodInputs
        Light and lobes of a bake.
    albedo, multiscatter, chain, size, points
        See `split_sum`.

    Attributes
    ----------
    fits : list of LobeFit
        The fit of each lobe, with its errors.
    fit_error : float
        Mean of the lobes' errors, weighted by their albedo over the disk of a sphere map; see `LobeFit.error`.
    shading : SplitShading
        Cubes and tables on the device.
    """

    def __init__(
        self, inputs: MethodInputs, *, albedo: Albedo, multiscatter: bool, chain: bool, size: int | None, points: int
    ) -> None:
        self.name = "split-sum"
        self.fits = [fit_lobe(name, *lobe) for name, lobe in inputs.shapes.items()]
        self.fit_error = mean_error(self.fits)
        sources = Sources.of(inputs.light)
        brightest = max((fit.exact.max() for fit in self.fits), default=0.0)
        glossy = [fit for fit in self.fits if fit.exact.max() > (_FAINT * brightest if fit.alpha >= _BLURRED else 0)]
        others = [fit.exact for fit in self.fits if fit not in glossy]
        albedos = [fit.exact if albedo == "exact" else fit.fitted for fit in glossy]
        levels = mip_chain(sources, size or SHARP) if chain else None
        lobes = [
            GlossyLobe(_cube(sources, fit.alpha, levels, size), CosineTable.of(one))
            for fit, one in zip(glossy, albedos, strict=True)
        ]
        matte = sum([*(fit.matte for fit in self.fits), *others], start=np.zeros((NODES, 3)))
        again = multiple_scattering(glossy, albedos) if multiscatter else np.zeros((NODES, 3))
        irradiance = HarmonicIrradiance.of(light_coefficients(inputs.light))
        diffuse = CosineTable.of(matte + again)
        highlights = DeltaHighlights.of(inputs.light, glossy, diffuse)
        super().__init__(inputs, SplitShading(lobes, diffuse, irradiance, highlights), points)


def _cube(sources: Sources, alpha: float, levels: list[BorderedTexels] | None, size: int | None) -> PrefilteredCube:
    """Cube of a lobe: its own, or between two levels of the chain."""
    return PrefilteredCube.exact(sources, alpha, size) if levels is None else PrefilteredCube.in_chain(levels, alpha)


@register(
    "split-sum",
    summary="Karis (2013): GGX-prefiltered cube times a two-term albedo, as engines do",
    needs=Needs(light=True, lobes=True),
    sees_delta_lights=True,
    rank=80,
)
def split_sum(
    inputs: MethodInputs,
    *,
    albedo: Albedo = "dfg",
    multiscatter: bool = False,
    chain: bool = False,
    size: int | None = None,
    points: int = POINTS,
) -> SplitSum:
    """Make the method.

    Parameters
    ----------
    inputs : MethodInputs
        Light and lobes of a bake.
    albedo : {"dfg", "exact"}
        Factor of a glossy lobe: F₀ A + F₉₀ B with fitted reflectances, as engines have it, or the lobe's own
        directional albedo.
    multiscatter : bool
        Add the light scattered more than once between microfacets (Fdez-Agüera 2019). Off by default, as printed by
        Karis; Mitsuba's conductors scatter once.
    chain : bool
        Look lobes up between two MIP levels of one chain, as engines store it, and not in a cube of their own
        roughness.
    size : int, optional
        Texels a side of a face of each cube, or of the finest level of the chain; by default chosen by the roughness.
    points : int
        Points along a side of a map's texel, whose mean the texel shows.
    """
    choice("albedo", albedo, get_args(Albedo))
    return SplitSum(
        inputs,
        albedo=albedo,
        multiscatter=flag("multiscatter", multiscatter),
        chain=flag("chain", chain),
        size=None if size is None else whole("size", size, LEAST_SIZE, MOST_SIZE),
        points=whole("points", points, 1, MOST_POINTS),
    )
