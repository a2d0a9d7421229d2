"""Whether a camera shows an object from outside, judged by what the rays of a picture met."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr import backend
from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.pictures.picture import Picture
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import first_surfaces

_MANY = 0.5
"""Share of hits on inner sides from which a picture is looked into."""

_DIRECTIONS = 4096


@backend.in_session
def view_notes(picture: Picture, scene: ObjectScene, camera: Camera, *, is_single: bool = True) -> tuple[str, ...]:
    """Check that a picture shows the outside of an object.

    A single picture without the object is a mistake of the camera, and refused; in a sequence it is a frame like any
    other, with a note. A picture from inside a closed surface is refused in both: bakes hold the light that reaches an
    outside. Open surfaces seen from behind, and surfaces that are inside out, are shaded on the viewer's side, with a
    note.

    Parameters
    ----------
    picture : Picture
        As rendered.
    scene : ObjectScene
        What it shows.
    camera : Camera
        Where it was taken.
    is_single : bool
        Whether it is the only picture, not a frame of a sequence.

    Returns
    -------
    tuple of str
        Notes, in a sentence each.

    Raises
    ------
    InputError
        If nothing of the object is seen in a single picture, or the camera is inside of a closed surface.
    """
    if not picture.alpha.any():
        reason = _why_unseen(scene, camera)
        if is_single:
            fix = "move the camera, or leave it out: the default one shows the whole object"
            raise InputError(f"no ray meets '{scene.name}': {reason}", where="camera", fix=fix)
        return (f"nothing of '{scene.name}' is seen: {reason}",)
    hits, back = picture.counts.hits, picture.counts.back
    if back == 0:
        return ()
    share = back / max(hits, 1)
    if share > _MANY and _is_enclosed(scene, camera):
        fix = f"move it out of the box {_box(scene)}, or leave it out: the default one shows the whole object"
        raise InputError(f"it is inside '{scene.name}'", where="camera", fix=fix)
    seen = f"{share:.0%}" if share >= 0.01 else f"{share:.2%}"
    return (f"{seen} of the rays meet the inner side of a surface, which is shaded like the outer one",)


def _why_unseen(scene: ObjectScene, camera: Camera) -> str:
    corners = np.array(np.meshgrid(*scene.bounds.T, indexing="ij")).reshape(3, -1).T - camera.position
    if (corners @ camera.forward <= 0).all():
        return "it is behind the camera"
    distance = float(np.linalg.norm(scene.centre - camera.position))
    pixel = 2 * camera.half_width * camera.window[2] / camera.width * distance
    if scene.radius < pixel:
        return f"at a distance of {distance:.3g} it is smaller than a pixel"
    return f"it lies out of view, in the box {_box(scene)}"


def _box(scene: ObjectScene) -> str:
    least, most = (", ".join(f"{x:.3g}" for x in corner) for corner in scene.bounds)
    return f"({least}) to ({most})"


def _is_enclosed(scene: ObjectScene, camera: Camera) -> bool:
    """Whether all directions from the camera meet the inner side of a surface.

    Of an object seen through an opening some directions are free; of one that is inside out, seen from outside, too.
    """
    if not ((scene.bounds[0] <= camera.position) & (camera.position <= scene.bounds[1])).all():
        return False
    index = dr.arange(mi.Float, _DIRECTIONS) + 0.5
    golden = index * 0.6180339887498949
    direction = mi.warp.square_to_uniform_sphere(mi.Point2f(index / _DIRECTIONS, golden - dr.floor(golden)))
    eye = mi.Point3f(*(dr.opaque(mi.Float, float(x)) for x in camera.position))
    met = first_surfaces(scene.geometry, mi.Ray3f(eye, direction))
    return int(dr.count(met.hit & met.is_back)[0]) >= 0.98 * _DIRECTIONS
