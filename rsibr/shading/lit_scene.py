"""Complete Mitsuba scene of objects with bakes: their own materials, and the environment that the bakes were lit by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mitsuba as mi

from rsibr.baking.scene import Scene
from rsibr.errors import BakeError, InputError
from rsibr.shading.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.store.bake import Bake


def lit_scene(
    scene: ObjectScene, types: SurfaceTypes, bakes: Mapping[str, Bake], extra: Mapping[str, Any] | None = None
) -> mi.Scene:
    """Scene that Mitsuba can path-trace: what the pictures from bakes approximate.

    Parameters
    ----------
    scene : ObjectScene
        Shapes; those without a bake keep the BSDF of their file.
    types : SurfaceTypes
        Type of each shape.
    bakes : mapping of str to Bake
        Bake of each type, in the order of `types.names`. The files that they were made from must exist, unchanged.
    extra : mapping, optional
        Further entries of the scene's dictionary, such as sensor and integrator.

    Raises
    ------
    BakeError
        If an input of a bake has changed.
    InputError
        If bakes were lit by different environments: no scene has two.
    """
    prepared = [_unchanged(bake) for bake in bakes.values()]
    require_one_light(bakes)
    for name, index in types.of_shape.items():
        scene.shapes[name].set_bsdf(prepared[index].material.bsdf())
    emitter = prepared[0].environment.emitter()
    return scene.loaded({"environment": emitter, **(extra or {})})


def require_one_light(bakes: Mapping[str, Bake]) -> None:
    """Raise an InputError unless all bakes were lit by the same environment."""
    first: tuple[str, object] | None = None
    for name, bake in bakes.items():
        light = bake.manifest.identity["environment"]
        if first is not None and light != first[1]:
            raise InputError(
                f"the bakes of '{first[0]}' and '{name}' were lit by different environments",
                where="bake",
                fix="bake both under one environment",
            )
        first = first or (name, light)


def _unchanged(bake: Bake) -> Scene:
    scene = Scene.prepare(bake.config)
    for kind, digest in scene.digests.items():
        if bake.manifest.identity[kind]["content"] != digest:
            raise BakeError(
                f"the {kind} has changed since the bake", where=str(bake.path), fix="bake anew with --fresh"
            )
    return scene
