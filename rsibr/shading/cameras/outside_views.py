"""Pixels whose view lies outside the stored ones: of a bake whose views do not surround the sphere."""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr import backend
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import first_surfaces


@backend.in_session
def outside_notes(
    scene: ObjectScene, types: SurfaceTypes, stored: Sequence[Viewpoints], camera: Camera
) -> tuple[str, ...]:
    """Note how much of a picture is seen from where no stored views surround the direction to the viewer.

    Parameters
    ----------
    scene : ObjectScene
        What is seen.
    types : SurfaceTypes
        Bake of each shape.
    stored : sequence of Viewpoints
        Stored views of each type's bake, in the order of `types.names`.
    camera : Camera
        Where the picture is taken; one ray through the middle of each pixel is asked.

    Returns
    -------
    tuple of str
        One sentence; none if every view lies between stored ones.
    """
    if not any(one.is_partial for one in stored):
        return ()
    rays = camera.on_device()
    seen = first_surfaces(scene.geometry, rays.ray(rays.centre(dr.arange(mi.UInt32, camera.width * camera.height))))
    kind, views = np.array(types.of(seen)), np.array(seen.v).T
    outside = sum(int((~one.covers(views[kind == index])).sum()) for index, one in enumerate(stored))
    if not outside:
        return ()
    share = outside / int(np.isin(kind, range(len(stored))).sum())
    shown = f"{share:.0%}" if share >= 0.01 else f"{share:.2%}"
    return (f"{shown} of the pixels are seen from outside the stored views; the nearest of them answer",)
