"""Prediction P of `rsibr` for whole maps: narrow Gaussians from one half-vector pyramid, one lookup a texel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import drjit as dr
import mitsuba as mi

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.lobe_terms import Lobe
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame
from rsibr.methods.rsibr.delta_lobe import ROUGH, DeltaLobe, mirror_of
from rsibr.methods.rsibr.fidelity import FAST, Fidelity
from rsibr.methods.rsibr.half_vector_map import half_vector_point
from rsibr.methods.rsibr.half_vector_pyramid import HalfVectorPyramid, balance, balanced, lookup
from rsibr.methods.rsibr.matte_light import MatteLight
from rsibr.methods.rsibr.model_tables import ModelTables
from rsibr.methods.rsibr.narrow_gaussians import NarrowGaussians
from rsibr.methods.rsibr.polar_grid import PolarGrid
from rsibr.methods.rsibr.wide_light import WideLight
from rsibr.methods.texel_mean import radial_mean

MapTables = tuple["mi.Float | None", "PolarGrid | None"]
"""What is gathered once a map: the collapsed half-vector pyramid, and the light of the wide Gaussians."""


_STEP, _MOST = 0.12, 4  # angle of normals [rad] that one point of a texel stands for, and points of a texel at most
_FINE_MAP = 200  # texels a side from which one point stands for every texel, those at the rim too
_FLATTEST = 0.02  # cosine below which their number does not grow further


@dataclass(eq=False)
class HalfVectorLobes:
    """All lobes of a material under an environment, for sphere maps of one size; docs/method.md, eq. 31.

    Attributes
    ----------
    light : EnvironmentPyramid
        Gaussian pyramid of the environment.
    levels : list of CosineTable
        Weight of each level of the half-vector pyramid; empty where no Gaussian needs them.
    balance : mi.Float
        Factors on the collapsed pyramid; see `half_vector_pyramid.balance`.
    sharp : NarrowGaussians or None
        Gaussians narrower than level 0, delta lobes excepted; None if there are none.
    wide : WideLight or None
        Wide Gaussians.
    mirror : (DeltaLobe, CosineTable) or None
        Delta lobe and its albedo; None if there is none.
    matte : list of MatteLight
        Matte parts.
    fidelity : Fidelity
        How finely the light is gathered.
    """

    light: EnvironmentPyramid
    levels: list[CosineTable]
    balance: mi.Float
    sharp: NarrowGaussians | None
    wide: WideLight | None
    mirror: tuple[DeltaLobe, CosineTable] | None
    matte: list[MatteLight]
    fidelity: Fidelity

    @classmethod
    def of(
        cls,
        lobes: Sequence[Lobe],
        pyramid: EnvironmentPyramid,
        light: Light,
        part: LobeShape | None = None,
        density: float = ROUGH,
        fidelity: Fidelity = FAST,
    ) -> LobesOfMaps:
        """Prepare the lobes; parameters as of `LobeIntegral.of`, and how finely the light is gathered.

        Returns
        -------
        callable
            Texels a side of a map → `HalfVectorLobes` for it, the same each time.
        """
        tables = ModelTables.of(lobes, part, fidelity)
        finest = fidelity.resolution
        wide = None if tables.wide is None else WideLight.from_tables(tables.wide)
        mirror, matte = mirror_of(lobes, pyramid, light, part, density), MatteLight.of(tables.matte, light)

        @cache
        def of_maps(resolution: int) -> HalfVectorLobes:
            sized = tables.for_maps(resolution)
            all_levels = [CosineTable.of(level) for level in sized.all_levels]
            return cls(
                light=pyramid,
                levels=[] if sized.levels is None else [CosineTable.of(level) for level in sized.levels],
                balance=mi.Float(0) if sized.levels is None else balance(all_levels, finest),
                sharp=None if sized.sharp is None else NarrowGaussians.from_tables(sized.sharp),
                wide=wide,
                mirror=mirror,
                matte=matte,
                fidelity=fidelity,
            )

        return of_maps

    def tables(self, frame: mi.Matrix3f) -> MapTables:
        """Gather the light of the Gaussians over the map with `frame`, columns x, y, v; for `radiance`."""
        if not self.levels and self.wide is None:
            return None, None
        pyramid = HalfVectorPyramid.of(frame, self.light, self.fidelity.resolution)
        grid = None if self.wide is None else self.wide.grid(pyramid)
        return balanced(pyramid, self.levels, self.balance) if self.levels else None, grid

    def radiance(
        self, n: mi.Vector3f, frame: mi.Matrix3f, tables: MapTables, resolution: int, mirror: bool = True
    ) -> mi.Color3f:
        """Prediction P: mean reflected radiance over a texel of a sphere map; docs/method.md, eq. 31.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals at the texels' centres in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        tables : MapTables
            From `tables`.
        resolution : int
            Texels a side of the map.
        mirror : bool
            Whether to include the delta lobe.

        Returns
        -------
        mi.Color3f
            [W sr⁻¹ m⁻²].
        """
        spacing = mi.Float(2 / resolution)
        if resolution >= _FINE_MAP:
            radiance = self._smooth(n, frame, tables, spacing)
        else:
            points = mi.UInt32(dr.clip(dr.ceil(spacing / (_STEP * dr.maximum(n.z, _FLATTEST))), 1, _MOST))
            width = spacing / mi.Float(points)
            radiance = radial_mean(n, spacing, points, lambda normal: self._smooth(normal, frame, tables, width))
        if self.mirror is not None and mirror:
            mirrored, share = self.mirror
            radiance += mirrored.mean_over_texel(n, frame, spacing, share.colour)
        return radiance

    def _smooth(self, n: mi.Vector3f, frame: mi.Matrix3f, tables: MapTables, spacing: mi.Float) -> mi.Color3f:
        """Radiance of all lobes but the delta lobe over a part of a texel that is `spacing` wide."""
        half_vectors, grid = tables
        # ---- Narrow Gaussians: one lookup in the collapsed pyramid; wide ones: one in the polar grid ----
        radiance = mi.Color3f(0)
        if half_vectors is not None:
            found = lookup(half_vectors, half_vector_point(n), self.fidelity.resolution)
            radiance += mi.Color3f(found.x, found.y, found.z)
        if self.wide is not None and grid is not None:
            radiance += self.wide.radiance(n, grid)
        # ---- Matte parts: irradiance at the normal ----
        world = frame @ n
        for matte in self.matte:
            radiance += matte.radiance(world, n.z)
        # ---- Gaussians narrower than level 0: anisotropic footprints (section 7.6) ----
        if self.sharp is None:
            return radiance
        shading = ShadingFrame.in_map(n, frame)
        return radiance + self.sharp.radiance(shading, spacing, self.fidelity.look_up(self.light))


LobesOfMaps = Callable[[int], HalfVectorLobes]
"""Texels a side of a map → the lobes prepared for it."""
