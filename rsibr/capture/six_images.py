"""`rsibr capture six`: six images, or six renders of a scene, become an environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr import backend
from rsibr.capture.curves.chosen import chosen_curve
from rsibr.capture.curves.curve import Curve
from rsibr.capture.linear_image import linear_image
from rsibr.capture.panorama import Panorama, as_latlong
from rsibr.capture.rendered_faces import rendered_faces
from rsibr.capture.synthetic.rendering import MOST_RAYS
from rsibr.errors import InputError
from rsibr.geometry.projections.cube import CUBE
from rsibr.geometry.projections.faces import FACES
from rsibr.geometry.projections.sphere_image import SphereImage
from rsibr.scene.panorama.faces import stacked_faces

_MOST_FACE, _MOST_SAMPLES, _MOST_SEED = 4096, 65536, 2**31


@backend.in_session
def capture_six(
    faces: Mapping[str, Path | str] | None = None,
    *,
    scene: Path | str | None = None,
    at: ArrayLike = (0.0, 0.0, 0.0),
    size: int = 256,
    samples: int = 256,
    seed: int = 0,
    height: int | None = None,
    curve: str | Path | Curve = "srgb",
) -> Panorama:
    """Make an environment of six images, or of six renders of a scene.

    Parameters
    ----------
    faces : mapping of str to path, optional
        Files of the faces px, nx, py, ny, pz, nz, in the orientation of the projection `cube`, with pixel centres
        inside the faces, not on the edges of the cube.
    scene : path, optional
        Mitsuba XML that is rendered instead.
    at : array_like, shape (3,)
        Place in the scene from which it is rendered.
    size : int
        Pixels along a side of a rendered face, up to 4096.
    samples, seed : int
        Paths a pixel of a render, and their seed.
    height : int, optional
        Rows of the map; by default as many as hold the detail of the faces.
    curve : str, path or Curve
        Of images that are not linear.

    Raises
    ------
    InputError
        If neither or both are given, a face is missing or has another size, the scene cannot be loaded or sends no
        light to the place, or a number is out of range.
    """
    if (faces is None) == (scene is None):
        raise InputError("six images and a scene" if faces else "no images and no scene", where="six", fix="give one")
    if not 1 <= size <= _MOST_FACE:
        raise InputError(f"{size} pixels a side", where="size", fix=f"give 1 to {_MOST_FACE}")
    if not 1 <= samples <= _MOST_SAMPLES:
        raise InputError(f"{samples} paths a pixel", where="samples", fix=f"give 1 to {_MOST_SAMPLES}")
    if size**2 * samples > MOST_RAYS:
        what = f"{size} × {size} pixels of {samples} paths"
        raise InputError(what, where="samples", fix=f"give at most {MOST_RAYS // size**2}, or a smaller --size")
    if not 0 <= seed < _MOST_SEED:
        raise InputError(f"a seed of {seed}", where="seed", fix=f"give 0 to {_MOST_SEED - 1}")
    notes: tuple[str, ...] = ()
    if scene is not None:
        rendered = rendered_faces(scene, at, size, samples=samples, seed=seed)
        values, notes = rendered.faces, rendered.notes
        source = f"rendered from {Path(scene).name} at {','.join(f'{value:g}' for value in np.asarray(at, float))}"
    else:
        values, notes = _faces(faces or {}, curve)
        source = "six images"
    rows = height or CUBE.latlong_size(*values.shape[1:3])[0]
    return Panorama(as_latlong(SphereImage(CUBE, values), rows), source, notes)


def _faces(faces: Mapping[str, Path | str], curve: str | Path | Curve) -> tuple[NDArray[np.float32], tuple[str, ...]]:
    """Radiance of six images, and a note on what is saturated in them."""
    missing = [face for face in FACES if face not in faces]
    if missing:
        raise InputError(f"no image for {', '.join(missing)}", where="faces", fix=f"give all of {', '.join(FACES)}")
    paths = {face: Path(faces[face]) for face in FACES}
    chosen = chosen_curve(curve)
    images = {face: linear_image(path, chosen) for face, path in paths.items()}
    stacked = stacked_faces({face: image.radiance for face, image in images.items()}, paths)
    burnt = float(np.mean([image.saturated.any(axis=2).mean() for image in images.values()]))
    note = f"{burnt:.1%} of the pixels are saturated: their radiance is a lower bound; see `rsibr capture hdr`"
    return stacked, (note,) if burnt else ()
