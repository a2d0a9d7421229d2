"""Complete Mitsuba scene of objects with bakes: their own materials, and the environment that the bakes were lit by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mitsuba as mi

from rsibr import backend
from rsibr.baking.baked_scene import scene_of
from rsibr.baking.scene import Scene
from rsibr.errors import InputError
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.store.bake import Bake


def lit_scene(
    scene: ObjectScene,
    types: SurfaceTypes,
    bakes: Mapping[str, Bake],
    extra: Mapping[str, Any] | None = None,
    prepared: Sequence[Scene] | None = None,
) -> mi.Scene:
    """Scene that Mitsuba can path-trace: what the pictures from bakes approximate.

    Parameters
    ----------
    scene : ObjectScene
        Shapes; those without a bake keep the BSDF of their file. Those with a bake are given its material.
    types : SurfaceTypes
        Type of each shape.
    bakes : mapping of str to Bake
        Bake of each type, in the order of `types.names`. The files that they were made from must exist, unchanged.
    extra : mapping, optional
        Further entries of the scene's dictionary, such as sensor and integrator.
    prepared : sequence of Scene, optional
        Scene of each bake if they are prepared already, see `prepared_scenes`.

    Raises
    ------
    BakeError
        If an input of a bake has changed.
    InputError
        If bakes were lit by different environments: no scene has two.

    Notes
    -----
    Both sides of a surface reflect, as in pictures: meshes whose faces are turned inside out are not black.
    """
    require_one_light(bakes)
    prepared = prepared_scenes(bakes) if prepared is None else prepared
    materials = [two_sided(one.material.bsdf()) for one in prepared]
    for name, index in types.of_shape.items():
        scene.shapes[name].set_bsdf(materials[index])
    emitter = prepared[0].environment.emitter()
    return scene.loaded({"environment": emitter, **(extra or {})})


def prepared_scenes(bakes: Mapping[str, Bake]) -> list[Scene]:
    """Scene of each bake, in order; one that stands for several names is prepared once.

    Raises
    ------
    BakeError
        If an input of a bake has changed.
    """
    scenes = {path: scene_of(bake) for path, bake in {bake.path: bake for bake in bakes.values()}.items()}
    return [scenes[bake.path] for bake in bakes.values()]


def two_sided(bsdf: mi.BSDF) -> mi.BSDF:
    """BSDF that reflects on both sides as the given one on its front, unless it covers both sides itself."""
    if mi.has_flag(bsdf.flags(), mi.BSDFFlags.BackSide):
        return bsdf
    return backend.load({"type": "twosided", "material": bsdf})


def require_one_light(bakes: Mapping[str, Bake]) -> None:
    """Raise an InputError unless all bakes were lit by the same environment."""
    first: tuple[str, object] | None = None
    for name, bake in bakes.items():
        light = bake.manifest.identity["environment"]["content"]
        if first is not None and light != first[1]:
            raise InputError(
                f"the bakes of '{first[0]}' and '{name}' were lit by different environments",
                where="bake",
                fix="bake both under one environment",
            )
        first = first or (name, light)
