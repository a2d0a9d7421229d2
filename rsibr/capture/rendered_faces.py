"""Six renders of a Mitsuba scene from a place in it, in the directions of a cube's faces (Miller & Hoffman 1984, 3)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr import backend
from rsibr.capture.cameras.mitsuba_sensor import sensor_of
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.errors import InputError
from rsibr.geometry.projections.cube import CUBE
from rsibr.geometry.projections.faces import FACES
from rsibr.regular_file import is_file

_UNSEEN = ("PointLight", "SpotLight", "DirectionalEmitter", "Projector")
"""Emitters without a surface: no camera sees them."""


@dataclass(frozen=True, eq=False)
class RenderedFaces:
    """Result of `rendered_faces`.

    Attributes
    ----------
    faces : ndarray, shape (6, N, N, 3), float32
        Radiance, in the order and orientation of the projection `cube`.
    notes : tuple of str
        What no camera sees.
    """

    faces: NDArray[np.float32]
    notes: tuple[str, ...]


@backend.in_session
def rendered_faces(scene: Path | str, at: ArrayLike, size: int, *, samples: int = 256, seed: int = 0) -> RenderedFaces:
    """Render what surrounds a place.

    Parameters
    ----------
    scene : path
        Mitsuba XML; its sensor and integrator are not used.
    at : array_like, shape (3,)
        World coordinates of the place.
    size : int
        Pixels along a side of a face.
    samples : int
        Paths a pixel.
    seed : int
        Of the paths.

    Raises
    ------
    InputError
        If the scene cannot be loaded, the place is not finite, or the light there is not finite, or black.
    """
    place = np.asarray(at, dtype=np.float64)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise InputError(f"the place {place.tolist()}", where="at", fix="give X,Y,Z")
    loaded = _loaded(Path(scene))
    integrator = backend.load({"type": "path"})
    faces = [_face(loaded, integrator, place, sheet, size, samples, seed) for sheet in range(len(FACES))]
    values, notes = np.stack(faces), _notes(loaded)
    where = ",".join(f"{value:g}" for value in place)
    if not np.isfinite(values).all():
        what = f"its light at {where} is not finite"
        raise InputError(what, where=str(scene), fix="correct the radiance of its emitters")
    if not values.any() and not notes:  # with lamps that no camera sees a map may be black until they are added
        fix = "choose a place with --at that is in the open, and not in an object"
        raise InputError(f"sends no light to {where}", where=str(scene), fix=fix)
    return RenderedFaces(values, notes)


def _face(
    scene: mi.Scene,
    integrator: mi.Integrator,
    place: NDArray[np.float64],
    sheet: int,
    size: int,
    samples: int,
    seed: int,
) -> NDArray[np.float32]:
    corner = CUBE.direction(mi.UInt32(sheet), mi.Point2f([0.5, 1.0, 0.5], [0.5, 0.5, 1.0]))
    middle, toward_right, toward_bottom = np.array(corner, dtype=np.float64).T
    right, down = (toward / (toward @ middle) - middle for toward in (toward_right, toward_bottom))
    axes = np.rint(np.stack([-right, down, middle], axis=1))  # a cube's faces are mirrored: no camera is
    camera = Pinhole(size, size, np.full(2, size / 2), np.full(2, size / 2), place, axes)
    sensor = backend.load(sensor_of(camera, samples))
    picture = mi.render(scene, sensor=sensor, integrator=integrator, spp=samples, seed=seed + sheet)
    return np.asarray(picture.numpy(), dtype=np.float32)[:, ::-1, :3]


def _loaded(path: Path) -> mi.Scene:
    if not is_file(path):
        raise InputError("there is no such scene", where=str(path), fix="name a Mitsuba XML file")
    try:
        with backend.loading():
            scene = mi.load_file(str(path))
    except RuntimeError as error:
        line = str(error).strip().splitlines()[-1]
        raise InputError(f"cannot be loaded: {line}", where=str(path), fix="correct the scene") from error
    if not isinstance(scene, mi.Scene):
        raise InputError("is no scene", where=str(path), fix="name a Mitsuba XML file with a <scene>")
    return scene


def _notes(scene: mi.Scene) -> tuple[str, ...]:
    kinds = sorted({kind for emitter in scene.emitters() if (kind := emitter.class_name()) in _UNSEEN})
    if not kinds:
        return ()
    return (f"{', '.join(kinds)}: seen by no camera; add them with `rsibr capture light`",)
