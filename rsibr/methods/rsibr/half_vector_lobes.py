"""Prediction P of `rsibr` for whole maps: all glossy lobes from one half-vector pyramid, one lookup a texel."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.rsibr.anisotropic_footprint import AnisotropicFootprint, ShadingFrame
from rsibr.methods.rsibr.delta_lobe import ROUGH, DeltaLobe
from rsibr.methods.rsibr.half_vector_map import half_vector_point
from rsibr.methods.rsibr.half_vector_pyramid import balance, finest_resolution, gathered, lookup
from rsibr.methods.rsibr.lobe_weights import LobeWeights, albedo_at_nodes, lobe_weights

Array = NDArray[np.float64]


@dataclass(eq=False)
class HalfVectorLobes:
    """All lobes of a material under an environment, for sphere maps of one resolution; docs/method.md, eq. 31.

    Attributes
    ----------
    light : EnvironmentPyramid
        Gaussian pyramid of the environment.
    resolution : int
        Texels a side of the half-vector pyramid's finest level.
    levels : list of CosineTable
        Weight of each level of the half-vector pyramid; empty where no lobe is glossy.
    balance : mi.Float
        Factors on the collapsed pyramid; see `half_vector_pyramid.balance`.
    sharp : CosineTable or None
        Weight and standard deviation of the Gaussians narrower than level 0, delta lobes excepted; None if there are
        none.
    mirror : (DeltaLobe, CosineTable) or None
        Delta lobe and its albedo; None if there is none.
    matte : list of (EnvironmentPyramid, CosineTable)
        Irradiance map and albedo of each matte lobe.
    """

    light: EnvironmentPyramid
    resolution: int
    levels: list[CosineTable]
    balance: mi.Float
    sharp: CosineTable | None
    mirror: tuple[DeltaLobe, CosineTable] | None
    matte: list[tuple[EnvironmentPyramid, CosineTable]]

    @classmethod
    def of(
        cls,
        lobes: list[tuple[LobeShape, Array]],
        pyramid: EnvironmentPyramid,
        light: Light,
        resolution: int,
        part: LobeShape | None = None,
        density: float = ROUGH,
    ) -> HalfVectorLobes:
        """Prepare the lobes for sphere maps of N×N texels.

        Parameters
        ----------
        lobes : list of (LobeShape, ndarray of shape (albedo nodes, 3))
            Shape and directional albedo of each lobe.
        pyramid, light
            Gaussian pyramid of the environment, and the environment itself.
        resolution : int
            Texels a side of the sphere maps, N.
        part : LobeShape, optional
            Predict this one of `lobes` only; the parts of all lobes add up to the whole.
        density : float
            Sampling density of a delta lobe: `EXACT` or `ROUGH`, see `DeltaLobe.of`.
        """
        finest = finest_resolution(resolution)
        glossy = [lobe for lobe in lobes if not lobe[0].is_matte and not lobe[0].is_mirror]
        mirrors = [albedo for shape, albedo in lobes if shape.is_mirror and part in (None, shape)]
        weights, whole = lobe_weights(glossy, finest, part), lobe_weights(glossy, finest)
        return cls(
            light=pyramid,
            resolution=finest,
            levels=_tables(weights) if glossy else [],
            balance=balance(_tables(whole), finest) if glossy else mi.Float(0),  # of the whole, so that parts add up
            sharp=CosineTable.of(weights.sharp) if weights.has_sharp else None,
            mirror=(DeltaLobe.of(light, pyramid, density), CosineTable.of(albedo_at_nodes(mirrors[0])))
            if mirrors
            else None,
            matte=[
                (
                    EnvironmentPyramid.of_irradiance(light.irradiance(shape.matte)),
                    CosineTable.of(albedo_at_nodes(albedo)),
                )
                for shape, albedo in lobes
                if shape.is_matte and part in (None, shape)
            ],
        )

    def gathered(self, frame: mi.Matrix3f) -> mi.Float:
        """Radiance of all glossy lobes over the half-vector map of `frame`, columns x, y, v; for `radiance`."""
        if not self.levels:
            return mi.Float(0)
        return gathered(frame, self.light, self.levels, self.balance, self.resolution)

    def radiance(
        self, n: mi.Vector3f, frame: mi.Matrix3f, half_vectors: mi.Float, spacing: mi.Float, mirror: bool = True
    ) -> mi.Color3f:
        """Prediction P: mean reflected radiance over a texel of a sphere map; docs/method.md, eq. 31.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals at the texels' centres in the map's frame.
        frame : mi.Matrix3f
            Columns x, y, v of the map's frame.
        half_vectors : mi.Float
            From `gathered`.
        spacing : mi.Float
            Distance of neighbouring texels in radii of the disk.
        mirror : bool
            Whether to include the delta lobe.

        Returns
        -------
        mi.Color3f
            [W sr⁻¹ m⁻²].
        """
        # ---- Glossy lobes: one lookup in the collapsed pyramid ----
        radiance = mi.Color3f(0)
        if self.levels:
            radiance += _colour(lookup(half_vectors, self.resolution, half_vector_point(n)))
        # ---- Matte lobes: irradiance at the normal ----
        world = frame @ n
        for irradiance, albedo in self.matte:
            radiance += _colour(albedo.at(n.z)) * irradiance.fetch(world, mi.UInt32(0))
        # ---- Delta lobe: mean over the texel ----
        if self.mirror is not None and mirror:
            mirrored, share = self.mirror
            radiance += mirrored.mean_over_texel(n, frame, spacing, lambda cosine: _colour(share.at(cosine)))
        # ---- Sharp part: one anisotropic footprint for all Gaussians narrower than level 0 (section 7.6) ----
        if self.sharp is None:
            return radiance
        weight = self.sharp.at(n.z)
        shading = ShadingFrame.of(world, mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2]))
        sharp = AnisotropicFootprint.of(shading, weight.w, spacing).two_taps(self.light.nearest_blurred)
        return radiance + _colour(weight) * sharp


def _tables(weights: LobeWeights) -> list[CosineTable]:
    return [CosineTable.of(level) for level in weights.levels]


def _colour(values: mi.Vector4f) -> mi.Color3f:
    return mi.Color3f(values.x, values.y, values.z)
