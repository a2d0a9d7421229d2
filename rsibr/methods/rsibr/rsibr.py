"""The method `rsibr`: as `rsibr-fine`, with a model that is quick for whole maps."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.light.environment_pyramid import LightStack
from rsibr.light.radiance import Light
from rsibr.lobes.gaussians import LobeKernel
from rsibr.methods.rsibr.anisotropic_footprint import Slant, Streak
from rsibr.methods.rsibr.cosine_table import AngleTable
from rsibr.methods.rsibr.delta_lobe import ROUGH, MirroredLight
from rsibr.methods.rsibr.half_vector_map import facet_point
from rsibr.methods.rsibr.half_vector_pyramid import balance, finest_resolution, gathered, lookup
from rsibr.methods.rsibr.lobe_weights import LobeWeights, albedo_at_nodes, lobe_weights

Array = NDArray[np.float64]


@dataclass(eq=False)
class PrefilteredLobes:
    """All lobes of a material under a light, for sphere maps of one resolution.

    Attributes
    ----------
    light : LightStack
        The light, blurred.
    resolution : int
        Texels a side of the facet pyramid's first level.
    levels : list of AngleTable
        Weight of each level of the pyramid; none where no lobe is glossy.
    balance : mi.Float
        Factors on the pyramid's sum; see `facet_pyramid.balance`.
    sharp : AngleTable or None
        Weight and width of what is narrower than the first level, deltas aside; None where nothing is.
    mirror : (MirroredLight, AngleTable) or None
        The light as a delta lobe shows it, and the albedo of that; None where there is none.
    matte : list of (LightStack, AngleTable)
        Irradiance and albedo of each matte lobe.
    """

    light: LightStack
    resolution: int
    levels: list[AngleTable]
    balance: mi.Float
    sharp: AngleTable | None
    mirror: tuple[MirroredLight, AngleTable] | None
    matte: list[tuple[LightStack, AngleTable]]

    @classmethod
    def of(
        cls,
        lobes: list[tuple[LobeKernel, Array]],
        stack: LightStack,
        light: Light,
        resolution: int,
        part: LobeKernel | None = None,
        density: float = ROUGH,
    ) -> PrefilteredLobes:
        """Prepare the lobes for sphere maps of N×N texels.

        Parameters
        ----------
        lobes : list of (LobeKernel, ndarray of shape (albedo nodes, 3))
            Kernel and directional albedo of each.
        stack, light
            The light, blurred; and as it is.
        resolution : int
            N.
        part : LobeKernel, optional
            The one of `lobes` to take alone; the parts of all add up to the whole.
        density : float
            How finely a delta lobe looks; see `MirroredLight`.
        """
        finest = finest_resolution(resolution)
        glossy = [lobe for lobe in lobes if not lobe[0].is_matte and not lobe[0].is_mirror]
        mirrors = [albedo for kernel, albedo in lobes if kernel.is_mirror and part in (None, kernel)]
        weights, whole = lobe_weights(glossy, finest, part), lobe_weights(glossy, finest)
        return cls(
            light=stack,
            resolution=finest,
            levels=_tables(weights) if glossy else [],
            balance=balance(_tables(whole), finest) if glossy else mi.Float(0),  # of all parts, so that they add up
            sharp=AngleTable.of(weights.sharp) if weights.has_sharp else None,
            mirror=(MirroredLight.of(light, stack, density), AngleTable.of(albedo_at_nodes(mirrors[0])))
            if mirrors
            else None,
            matte=[
                (LightStack.irradiance(light.picture, kernel.matte), AngleTable.of(albedo_at_nodes(albedo)))
                for kernel, albedo in lobes
                if kernel.is_matte and part in (None, kernel)
            ],
        )

    def gathered(self, frame: mi.Matrix3f) -> mi.Float:
        """Light of all glossy lobes over the facet map of `frame`, columns x, y, v; for `radiance`."""
        if not self.levels:
            return mi.Float(0)
        return gathered(frame, self.light, self.levels, self.balance, self.resolution)

    def radiance(self, n: mi.Vector3f, frame: mi.Matrix3f, facets: mi.Float, spacing: mi.Float) -> mi.Color3f:
        """Mean radiance over a texel of a sphere map that the lobes reflect.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals at the texels' centres in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        facets : mi.Float
            From `gathered`.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk.
        """
        radiance = mi.Color3f(0)
        if self.levels:
            radiance += _colour(lookup(facets, self.resolution, facet_point(n)))
        world = frame @ n
        for irradiance, albedo in self.matte:
            radiance += _colour(albedo.at(n.z)) * irradiance.fetch(world, mi.UInt32(0))
        if self.mirror is not None:
            mirrored, share = self.mirror
            radiance += mirrored.mean_over_texel(n, frame, spacing, lambda cosine: _colour(share.at(cosine)))
        if self.sharp is None:
            return radiance
        weight = self.sharp.at(n.z)
        slant = Slant.of(world, mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2]))
        sharp = Streak.of(slant, weight.w, spacing).at_two_places(self.light.roughly_blurred)
        return radiance + _colour(weight) * sharp


def _tables(weights: LobeWeights) -> list[AngleTable]:
    return [AngleTable.of(level) for level in weights.levels]


def _colour(values: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(values.x, values.y, values.z)
