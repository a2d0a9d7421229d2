"""Scene of a finished bake, prepared again from the files that it was made from."""

from __future__ import annotations

from rsibr.baking.scene import Scene
from rsibr.errors import BakeError
from rsibr.store.bake import Bake


def scene_of(bake: Bake) -> Scene:
    """Prepare the scene of a bake again.

    Raises
    ------
    InputError
        If a file that the bake was made from is gone.
    BakeError
        If environment or material have changed since the bake, or it was captured.
    """
    require_rendered(bake)
    return require_unchanged(bake, Scene.prepare(bake.config))


def require_rendered(bake: Bake) -> None:
    """Raise a BakeError if the maps were captured: nobody knows the material, and no reference can be rendered."""
    if bake.manifest.capture is not None:
        what = "was captured: its material is not known, so that there is no reference to render"
        raise BakeError(what, where=str(bake.path), fix="see `rsibr check`, which holds each map against the others")


def require_unchanged(bake: Bake, scene: Scene) -> Scene:
    """Return the scene of a bake; raise a BakeError if environment or material have changed since the bake."""
    for kind, digest in scene.digests.items():
        if bake.manifest.identity[kind]["content"] != digest:
            raise BakeError(
                f"the {kind} has changed since the bake", where=str(bake.path), fix="bake anew with --fresh"
            )
    return scene
