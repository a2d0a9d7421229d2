"""What a page shows: a sphere of one bake, or an object and the bakes of its shapes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.publishing.bundle.encoding import Encoded
from rsibr.publishing.page.object_mesh import object_mesh
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.scenes.scene_file import open_scene
from rsibr.shading.surface_types import SurfaceTypes, lost_structure
from rsibr.store.bake import Bake

_VIEW_DEG = (30.0, 15.0)
"""Azimuth and elevation of the first view of a sphere or a mesh [degrees]."""

_FOV_DEG = 30.0

Source = str | Path | dict[str, Any]


@dataclass(frozen=True, eq=False)
class Subject:
    """What a page shows.

    Attributes
    ----------
    bakes : list of Bake
        Each bake once.
    camera : dict
        First view as the page's JSON holds it: target, radius, azimuth and elevation [radians], fov [degrees].
    name : str
        Name of the object; empty for the sphere.
    object : dict or None
        Mesh as the page's JSON holds it; None for the sphere.
    arrays : dict of str to Encoded
        Arrays of the mesh.
    notes : list of str
        What of the object is not shown as it is.
    """

    bakes: list[Bake]
    camera: dict[str, Any]
    name: str = ""
    object: dict[str, Any] | None = None
    arrays: dict[str, Encoded] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def sphere_of(bake: Bake) -> Subject:
    """The unit sphere in the parallel projection, as a sphere map shows it."""
    azimuth, elevation = (math.radians(angle) for angle in _VIEW_DEG)
    view = {"azimuth": azimuth, "elevation": elevation, "fov": 0}
    return Subject([bake], {"target": [0.0, 0.0, 0.0], "radius": 1.0, **view})


@backend.in_session
def object_of(source: Source, named: Mapping[str, Bake], *, allow_large: bool = False) -> Subject:
    """An object whose shapes have bakes.

    Parameters
    ----------
    source : path, str or dict
        Mitsuba scene, mesh file, or "sphere", as `rsibr.render` takes it.
    named : mapping of str to Bake
        Bake of each shape by id; `"*"` stands for all shapes without one of their own.
    allow_large : bool
        Take a mesh of any size.

    Raises
    ------
    InputError
        If the object cannot be read, has no shape of a name, or too many triangles.
    """
    scene = open_scene(source)
    types = SurfaceTypes.assign(scene, list(named))
    if not types.of_shape:
        raise InputError("no shape has a bake", where=scene.name, fix="give BAKE for all shapes, or ID=BAKE")
    bakes = list({bake.path: bake for bake in named.values()}.values())
    numbers = [bakes.index(next(one for one in bakes if one.path == bake.path)) for bake in named.values()]
    mesh = object_mesh(scene, {name: numbers[kind] for name, kind in types.of_shape.items()}, allow_large=allow_large)
    return Subject(bakes, _camera(scene), scene.name, mesh.meta, mesh.arrays, _notes(scene, types, bakes))


def _camera(scene: ObjectScene) -> dict[str, Any]:
    azimuth, elevation = (math.radians(angle) for angle in _VIEW_DEG)
    fov = _FOV_DEG
    if scene.camera is not None:
        direction, fov = _seen_from(scene.camera, scene.centre), scene.camera.fov_deg
        azimuth = math.atan2(direction[0], direction[2])
        elevation = math.asin(np.clip(direction[1], -1, 1))
    first = {"azimuth": azimuth, "elevation": elevation, "fov": round(min(max(fov, 5.0), 90.0), 1)}
    return {"target": scene.centre.tolist(), "radius": scene.radius, **first}


def _seen_from(camera: Camera, centre: NDArray[np.float64]) -> NDArray[np.float64]:
    away = camera.position - centre
    return np.asarray(away / max(float(np.linalg.norm(away)), 1e-30))


def _notes(scene: ObjectScene, types: SurfaceTypes, bakes: list[Bake]) -> list[str]:
    notes = list(scene.notes)
    if unbaked := types.unbaked(scene):
        named = ", ".join(f"'{name}'" for name in unbaked[:12])
        notes.append(f"grey, as {'it has' if len(unbaked) == 1 else 'they have'} no bake: {named}")
    notes += filter(None, (lost_structure(name, scene.shapes[name].bsdf()) for name in types.of_shape))
    if len({bake.manifest.identity["environment"]["content"] for bake in bakes}) > 1:
        notes.append("the bakes were lit by different environments; the background is that of the first")
    notes.append("the object casts no shadow on itself and does not mirror itself: `rsibr render` does both")
    return notes
