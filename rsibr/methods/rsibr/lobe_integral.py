"""Reflection integral of all lobes, term by term: the prediction P of `rsibr` and `rsibr-fine` for single points.

A narrow Gaussian is an anisotropic footprint around the mirror direction, sampled along its long axis
(`narrow_gaussians.py`). Wide ones are looked up in tables over normals and views (`view_nodes.py`). A matte part is a
lookup in an irradiance map, a delta lobe one in the environment.

P is an approximation. Its residual at the stored views is warped to the new view, so an error of P counts only as far
as it changes from view to view.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.lobe_terms import Lobe, LobeTerms
from rsibr.methods.rsibr.anisotropic_footprint import ShadingFrame
from rsibr.methods.rsibr.delta_lobe import ROUGH, DeltaLobe, mirror_of
from rsibr.methods.rsibr.half_vector_pyramid import HalfVectorPyramid
from rsibr.methods.rsibr.matte_light import MatteLight
from rsibr.methods.rsibr.narrow_gaussians import NarrowGaussians
from rsibr.methods.rsibr.polar_grid import PolarGrid
from rsibr.methods.rsibr.view_nodes import ViewNodes
from rsibr.methods.rsibr.wide_light import WideLight

_WIDE = 0.15  # standard deviation from which a Gaussian is wide: the tables of views are coarser than those of maps
_RATIO = 1.6  # greatest ratio of the widths of Gaussians that share a footprint


@dataclass(eq=False)
class LobeIntegral:
    """All lobes of a material under an environment; docs/method.md, eq. 15 and section 9.

    Attributes
    ----------
    environment : EnvironmentPyramid
        Gaussian pyramid of the environment.
    narrow : NarrowGaussians or None
        Gaussians gathered over footprints.
    wide : WideLight or None
        Wide Gaussians.
    matte : list of MatteLight
        Matte parts.
    mirror : (DeltaLobe, CosineTable) or None
        Delta lobe and its albedo.
    nodes : ViewNodes or None
        Tables of the wide Gaussians for single points, once `prepare_points` has made them.
    """

    environment: EnvironmentPyramid
    narrow: NarrowGaussians | None
    wide: WideLight | None
    matte: list[MatteLight]
    mirror: tuple[DeltaLobe, CosineTable] | None
    nodes: ViewNodes | None = None

    @classmethod
    def of(
        cls,
        lobes: Sequence[Lobe],
        pyramid: EnvironmentPyramid,
        light: Light,
        part: LobeShape | None = None,
        density: float = ROUGH,
    ) -> LobeIntegral:
        """Put the lobes on the device.

        Parameters
        ----------
        lobes : sequence of (LobeShape, ndarray of shape (albedo nodes, 3))
            Shape and directional albedo of each lobe.
        pyramid, light
            Gaussian pyramid of the environment, and the environment itself.
        part : LobeShape, optional
            Predict this one of `lobes` only; the parts of all lobes add up to the whole.
        density : float
            Sampling density of a delta lobe: `EXACT` or `ROUGH`, see `DeltaLobe.of`.
        """
        terms, parts = LobeTerms.pair(lobes, part, _WIDE)
        return cls(
            environment=pyramid,
            narrow=NarrowGaussians.of(terms.narrow, parts.narrow, ratio=_RATIO),
            wide=WideLight.of(terms.gaussians, parts.gaussians),
            matte=MatteLight.of(parts.matte, light),
            mirror=mirror_of(lobes, pyramid, light, part, density),
        )

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`.

        Parameters
        ----------
        n, v : mi.Vector3f
            Unit vectors in world coordinates, one pair a lane.

        Returns
        -------
        mi.Color3f
            P [W sr⁻¹ m⁻²]. Under a constant environment it is the albedo times the environment's radiance.
        """
        cosine = dr.dot(n, v)
        radiance = mi.Color3f(0)
        for matte in self.matte:
            radiance += matte.radiance(n, cosine)
        if self.mirror is not None:
            mirrored, share = self.mirror
            radiance += share.colour(cosine) * mirrored.fetch(2 * cosine * n - v)
        if self.wide is not None:
            self.prepare_points()
            assert self.nodes is not None
            radiance += self.nodes.radiance(n, v, cosine)
        if self.narrow is not None:
            radiance += self.narrow.radiance(ShadingFrame.of(n, v), mi.Float(0), self.environment.blurred)
        return radiance

    def grid(self, frame: mi.Matrix3f) -> PolarGrid | None:
        """Light of the wide Gaussians over the map with `frame`, columns x, y, v; None if there are none."""
        return None if self.wide is None else self.wide.grid(HalfVectorPyramid.of(frame, self.environment))

    def prepare_points(self) -> None:
        """Make what `radiance` needs beyond the tables of maps: the view nodes of the wide Gaussians."""
        if self.wide is not None and self.nodes is None:
            self.nodes = ViewNodes.of(self.wide, self.environment)

    def radiance_in_map(
        self, n: mi.Vector3f, frame: mi.Matrix3f, grid: PolarGrid | None, spacing: mi.Float, mirror: bool = True
    ) -> mi.Color3f:
        """Mean radiance over a texel of a sphere map.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals at the texels' centres in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        grid : PolarGrid or None
            From `grid`.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk; see `AnisotropicFootprint.of`.
        mirror : bool
            Whether to include the delta lobe.

        Returns
        -------
        mi.Color3f
            P [W sr⁻¹ m⁻²].
        """
        world, radiance = frame @ n, mi.Color3f(0)
        for matte in self.matte:
            radiance += matte.radiance(world, n.z)
        if self.mirror is not None and mirror:
            mirrored, share = self.mirror
            radiance += mirrored.mean_over_texel(n, frame, spacing, share.colour)
        if self.wide is not None and grid is not None:
            radiance += self.wide.radiance(n, grid)
        if self.narrow is not None:
            shading = ShadingFrame.of(world, mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2]))
            radiance += self.narrow.radiance(shading, spacing, self.environment.blurred)
        return radiance
