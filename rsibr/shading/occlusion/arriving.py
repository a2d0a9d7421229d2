"""Light that arrives at the points of all objects: past them from the sky, and by way of them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.methods.inputs import MethodInputs
from rsibr.shading.occlusion.covered_points import covered, from_neighbours
from rsibr.shading.occlusion.gathering import Irradiance, Places, gathered, ratio_of, reflected
from rsibr.shading.occlusion.material_parts import MaterialParts
from rsibr.shading.occlusion.point_field import PointField
from rsibr.shading.occlusion.sky import Sky
from rsibr.shading.occlusion.surface_points import SurfacePoints
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes

RAYS = 256
"""Cosine-weighted rays a point."""

BOUNCE_SHARE = 4
"""Rays to the sky for each ray to other surfaces, in each bounce: what they reflect varies less over directions."""

BOUNCES = 2
"""Reflections between surfaces that are followed; a further one is the square of a matte albedo times a share."""

MOST_RAYS = 2**25
"""Rays of the whole preparation to the sky; larger meshes get fewer a point."""

_FEWEST = 16


@dataclass(frozen=True, eq=False)
class ArrivingLight:
    """Irradiance at the points of a scene.

    Attributes
    ----------
    points : SurfacePoints
        Points.
    ratio : PointField
        Irradiance that arrives over that under the open sky, RGB.
    exitant : PointField
        Mean radiance that the surface reflects [W sr⁻¹ m⁻²].
    rays : int
        Rays a point to the sky.
    seconds : float
        Wall time of the gathering [s].
    """

    points: SurfacePoints
    ratio: PointField
    exitant: PointField
    rays: int
    seconds: float

    @classmethod
    def of(
        cls,
        scene: ObjectScene,
        types: SurfaceTypes,
        inputs: Sequence[MethodInputs],
        *,
        bounces: int = BOUNCES,
        rays: int = RAYS,
    ) -> ArrivingLight:
        """Gather the light at all vertices.

        Parameters
        ----------
        scene : ObjectScene
            Shapes; those without a bake hide the sky, and reflect nothing.
        types : SurfaceTypes
            Type of each shape.
        inputs : sequence of MethodInputs
            Inputs of the bake of each type.
        bounces : int
            Reflections between surfaces that are followed.
        rays : int
            Rays a point to the sky, at most.
        """
        start = time.perf_counter()
        points = SurfacePoints.of(scene.shapes, types.of_shape, scene.radius)
        rays = min(rays, max(MOST_RAYS // max(len(points), 1), _FEWEST))
        lit = [(index, one) for index, one in enumerate(inputs) if one.bake.manifest.light is not None]
        groups = [_Group.of(points, types, index, one) for index, one in lit]
        groups = [group for group in groups if group.rows.any()]
        plain, places = (
            PointField.of(points, scene.shapes),
            {id(group): group.places(points, scene) for group in groups},
        )
        sky = [gathered(scene.geometry, places[id(group)], group.sky, rays) for group in groups]
        bounced: list[NDArray[np.float64]] = [np.zeros_like(one.past) for one in sky]
        for _ in range(bounces):
            shining = plain.holding(_exitant(points, groups, sky, bounced))
            bounced = [
                reflected(scene.geometry, places[id(group)], shining, -(-rays // BOUNCE_SHARE), light.hidden)
                for group, light in zip(groups, sky, strict=True)
            ]
        values = np.ones((len(points), 3), np.float32)
        for group, light, more in zip(groups, sky, bounced, strict=True):
            values[group.rows] = ratio_of(light, more)
        hidden = covered(scene.geometry, points, scene.lift)
        ratio, exitant = (
            plain.holding(from_neighbours(field, hidden, points.corners))
            for field in (values, _exitant(points, groups, sky, bounced))
        )
        return cls(points, ratio, exitant, rays, time.perf_counter() - start)


@dataclass(frozen=True, eq=False)
class _Group:
    """Points of one surface type, with its sky and its hemispherical albedo."""

    rows: NDArray[np.bool_]
    sky: Sky
    albedo: NDArray[np.float64]

    @classmethod
    def of(cls, points: SurfacePoints, types: SurfaceTypes, index: int, inputs: MethodInputs) -> _Group:
        rows = np.zeros(len(points), np.bool_)
        for name, part in points.rows():
            rows[part] = types.of_shape[name] == index
        parts = MaterialParts.of(inputs)
        return cls(rows, Sky.of(inputs.light), parts.matte_albedo + parts.gloss_albedo)

    def places(self, points: SurfacePoints, scene: ObjectScene) -> list[Places]:
        """Points on the device."""
        return Places.of(points.positions[self.rows], points.normals[self.rows], scene.lift)


def _exitant(
    points: SurfacePoints, groups: list[_Group], sky: list[Irradiance], bounced: list[NDArray[np.float64]]
) -> NDArray[np.float32]:
    """Reflected radiance at all points, (N, 3): albedo times irradiance over π."""
    values = np.zeros((len(points), 3), np.float32)
    for group, light, more in zip(groups, sky, bounced, strict=True):
        values[group.rows] = group.albedo * (light.past + more) / np.pi
    return values
