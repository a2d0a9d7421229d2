"""`split-sum`: image-based lighting of real-time engines, a prefiltered cube times an albedo from two terms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.geometry.projections.sphere_map import covered_middle, normal_from_disk, texel_centre, tiled_texels
from rsibr.light.harmonic_irradiance import HarmonicIrradiance, light_coefficients
from rsibr.lobes.albedo import NODES
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.frozen import Frozen
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.map_texels import as_rgba, frame_from, laid_out, touches_disk, view_of
from rsibr.methods.protocol import Needs, PointwiseMethod
from rsibr.methods.registry import register
from rsibr.methods.split_sum.delta_highlights import DeltaHighlights
from rsibr.methods.split_sum.material_fit import fit_lobe, mean_error
from rsibr.methods.split_sum.multiple_scattering import multiple_scattering
from rsibr.methods.split_sum.prefiltered_cube import SHARP, PrefilteredCube, Sources, mip_chain

Albedo = Literal["dfg", "exact"]
"""Factor of a glossy lobe: F₀ A + F₉₀ B, or the lobe's own directional albedo."""

LEAST_SIZE, MOST_SIZE = 4, 1024
"""Limits of the option `size` [texels]."""

_FAINT, _BLURRED = 1e-3, 0.3  # share of the brightest lobe below which one of at least such a roughness gets no cube


@dataclass(eq=False)
class GlossyLobe:
    """One prefiltered cube and its factor.

    Attributes
    ----------
    cube : PrefilteredCube
        Environment prefiltered for the lobe's roughness, indexed by the mirror direction.
    albedo : CosineTable
        Directional albedo by the cosine of the view angle.
    """

    cube: PrefilteredCube
    albedo: CosineTable


@dataclass(eq=False)
class Shading:
    """What is looked up, on the device.

    Attributes
    ----------
    glossy : list of GlossyLobe
        Split sums that are added.
    diffuse : CosineTable
        Albedo of all that follows the normal, by the cosine of the view angle.
    irradiance : HarmonicIrradiance
        Irradiance by the normal.
    highlights : DeltaHighlights or None
        Reflections of delta lights; None if there are no such lights.
    """

    glossy: list[GlossyLobe]
    diffuse: CosineTable
    irradiance: HarmonicIrradiance
    highlights: DeltaHighlights | None

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        cosine = dr.dot(n, v)
        mirrored = 2 * cosine * n - v
        total = self.diffuse.colour(cosine) * self.irradiance.mean_radiance(n)
        for lobe in self.glossy:
            total += lobe.albedo.colour(cosine) * lobe.cube.lookup(mirrored)
        return total if self.highlights is None else total + self.highlights.radiance(n, v)


class SplitSum(PointwiseMethod):
    """Split sum: ∫ f L cos θ dω ≈ E(n·v) · (prefiltered environment in the mirror direction), for each glossy lobe.

    Parameters
    ----------
    inputs : MethodInputs
        Light and lobes of a bake.
    albedo, multiscatter, chain, size
        See `split_sum`.

    Attributes
    ----------
    fits : list of LobeFit
        The fit of each lobe, with its errors.
    fit_error : float
        Mean of the lobes' errors, weighted by their albedo over the disk of a sphere map; see `LobeFit.error`.
    shading : Shading
        Cubes and tables on the device.
    """

    def __init__(
        self, inputs: MethodInputs, *, albedo: Albedo, multiscatter: bool, chain: bool, size: int | None
    ) -> None:
        super().__init__(inputs)
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
        self.shading = Shading(lobes, diffuse, irradiance, DeltaHighlights.of(inputs.light, glossy, diffuse))
        self._frozen = Frozen(_image)

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """See `Method.eval`."""
        return self.shading.radiance(n, v)

    @backend.in_session
    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.TensorXf:
        """See `Method.map`; from the second view on it is replayed."""
        image = self._frozen(self.shading, mi.Float(frame.T.ravel().tolist()), resolution)
        return mi.TensorXf(image, (resolution, resolution, 4))

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """Trace the texels of a map, row-major RGBA, flat; `columns` holds the frame's columns as nine floats."""
        return _image(self.shading, columns, resolution)


def _image(shading: Shading, columns: mi.Float, resolution: int) -> mi.Float:
    to_world, texel = frame_from(columns), tiled_texels(resolution)
    p = texel_centre(texel, resolution)
    n = to_world @ normal_from_disk(covered_middle(p, resolution))
    radiance = shading.radiance(n, view_of(to_world))
    return laid_out(dr.select(touches_disk(p, resolution), as_rgba(radiance), 0), texel, resolution)


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
    """
    _require(albedo in get_args(Albedo), "albedo", albedo, f"use one of: {', '.join(get_args(Albedo))}")
    for name, value in (("multiscatter", multiscatter), ("chain", chain)):
        _require(isinstance(value, bool), name, value, "give true or false")
    is_size = type(size) is int and LEAST_SIZE <= size <= MOST_SIZE
    _require(size is None or is_size, "size", size, f"give {LEAST_SIZE} to {MOST_SIZE} texels")
    return SplitSum(inputs, albedo=albedo, multiscatter=multiscatter, chain=chain, size=size)


def _require(is_good: bool, option: str, value: object, fix: str) -> None:
    """Raise an InputError unless the value of an option, which users give, is good."""
    if not is_good:
        raise InputError(f"'{value}' is no {option}", where=f"split-sum, {option}", fix=fix)
