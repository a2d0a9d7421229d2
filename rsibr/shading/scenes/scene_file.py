"""Scenes to shade, opened from whatever a user has: a Mitsuba scene, a mesh file, or the word "sphere"."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rsibr import backend
from rsibr.errors import InputError
from rsibr.regular_file import is_file
from rsibr.shading.scenes.mesh_file import SUFFIXES, load_meshes
from rsibr.shading.scenes.mitsuba_scene import load_scene
from rsibr.shading.scenes.object_scene import ObjectScene

SPHERE = "sphere"
"""Source that stands for the unit sphere around the origin."""


@backend.in_session
def open_scene(source: Path | str | dict[str, Any]) -> ObjectScene:
    """Open a scene.

    Parameters
    ----------
    source : path, str or dict
        A Mitsuba scene (XML file or dictionary), a mesh file (PLY, OBJ, glTF, GLB, STL), or `"sphere"`, the unit sphere
        around the origin.

    Returns
    -------
    ObjectScene
        Shapes by id, camera of a Mitsuba scene's first perspective sensor, and notes on what is not used.

    Raises
    ------
    InputError
        If there is no such file, it is damaged or of another kind, or it holds no surface.
    MachineError
        If a mesh file does not fit into the memory.

    Examples
    --------
    >>> scene = open_scene("sphere")
    >>> list(scene.shapes), scene.radius > 1
    (['sphere'], True)
    """
    if isinstance(source, dict):
        return _bounded(ObjectScene("scene", *load_scene(source, "scene")))
    if source == SPHERE:
        return ObjectScene(SPHERE, {SPHERE: backend.load({"type": "sphere", "id": SPHERE})})
    path = Path(source)
    if not is_file(path):
        what = "it is a folder" if _is_folder(path) else "there is no such file"
        fix = f"name a Mitsuba XML file, a mesh ({', '.join(SUFFIXES)}), or '{SPHERE}'"
        raise InputError(what, where=str(path), fix=fix)
    suffix = path.suffix.lower()
    if suffix == ".xml":
        return _bounded(ObjectScene(path.name, *load_scene(path, str(path))))
    if suffix in SUFFIXES:
        shapes, notes = load_meshes(path)
        return _bounded(ObjectScene(path.name, shapes, None, notes))
    known = ", ".join((".xml", *SUFFIXES))
    what = f"no scene or mesh ends in '{suffix}'" if suffix else "its name has no ending"
    raise InputError(what, where=str(path), fix=f"give a file of one of the kinds {known}")


def _bounded(scene: ObjectScene) -> ObjectScene:
    if not (np.isfinite(scene.bounds).all() and 0 < scene.radius < 1e15):
        fix = "check transforms and vertices"
        raise InputError("it has no finite extent: coordinates that are no numbers", where=scene.name, fix=fix)
    return scene


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # a name that the system cannot hold
        return False
