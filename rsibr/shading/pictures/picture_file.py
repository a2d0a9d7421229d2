"""Files of a picture: EXR with layers, or PNG."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.machine import make_folder
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.pictures.picture import Picture
from rsibr.store import exr
from rsibr.store.atomic import write_atomic
from rsibr.store.image_kind import image_kind
from rsibr.store.png_file import Rgba, exposure_of, tone_mapped, write_png
from rsibr.version import __version__


@dataclass(frozen=True, eq=False)
class Origin:
    """What a picture was made of, for the header of its file.

    Attributes
    ----------
    camera : Camera
        Camera.
    bakes : mapping of str to str
        Name of the bake of each shape id.
    methods : mapping of str to str
        Method of each shape id.
    settings : mapping of str
        Rays, lookup, occlusion.
    """

    camera: Camera
    bakes: Mapping[str, str] = field(default_factory=dict)
    methods: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)


def write_picture(
    picture: Picture, path: Path | str, *, exposure: float | None = None, origin: Origin | None = None
) -> None:
    """Write a picture, atomically, in the format that the name's ending says. A missing folder is made.

    Parameters
    ----------
    picture : Picture
        Picture.
    path : path
        `.exr`: float32 in one part: R, G, B (premultiplied), A, and the layers depth.Z, normal.X, normal.Y, normal.Z.
        `.png`: sRGB in 8 bits with straight alpha.
    exposure : float, optional
        Factor on the radiance of a PNG; by default `exposure_of_pictures` of this one.
    origin : Origin, optional
        What it was made of; written into the header of an EXR.

    Raises
    ------
    InputError
        If the name has another ending, or the folder cannot be made.
    MachineError
        If the disk is full or fails.
    BakeError
        If the folder is not writable.

    Examples
    --------
    >>> picture = rsibr.render("sphere", "out/paint.rsibr")                    # doctest: +SKIP
    >>> write_picture(picture, "out/sphere.png")                               # doctest: +SKIP
    """
    kind = image_kind(path)
    make_folder(Path(path).parent)
    if kind == "exr":
        write_atomic(Path(path), encode_exr(picture, origin))
        return
    write_png(Path(path), display(picture, exposure_of_pictures([picture]) if exposure is None else exposure))


def encode_exr(picture: Picture, origin: Origin | None = None) -> bytes:
    """Bytes of the OpenEXR file of a picture, without times, so that equal pictures give equal bytes."""
    header = {
        "software": f"rsibr {__version__}",
        **({} if origin is None else _attributes(origin)),
    }
    rgba = np.concatenate([picture.radiance, picture.alpha[..., None]], axis=-1).astype(np.float32)
    layers = {"depth.Z": picture.depth} | {f"normal.{axis}": picture.normal[..., i] for i, axis in enumerate("XYZ")}
    channels = {name: np.asarray(layer, np.float32) for name, layer in ({"RGBA": rgba} | layers).items()}
    return exr.encode_exr(channels, header)


def exposure_of_pictures(pictures: list[Picture]) -> float:
    """Exposure, a factor on radiance, that suits all of some pictures; see `rsibr.store.png_file.exposure_of`."""
    brightest = [_straight(one)[one.alpha >= 0.5].max(axis=-1) for one in pictures]
    return exposure_of(np.concatenate(brightest)) if brightest else 1.0


def display(picture: Picture, exposure: float) -> Rgba:
    """Convert to sRGB with straight alpha, shape (H, W, 4), uint8."""
    return tone_mapped(_straight(picture), picture.alpha, exposure)


def on_black(picture: Picture, exposure: float) -> Rgba:
    """Convert to sRGB on a black background, opaque, shape (H, W, 4), uint8: what a film shows."""
    return tone_mapped(picture.radiance, np.ones_like(picture.alpha), exposure)


def camera_record(camera: Camera) -> dict[str, Any]:
    """Camera as JSON holds it."""
    return {
        "position": camera.position.tolist(),
        "axes": camera.axes.tolist(),
        "fov_deg": camera.fov_deg,
        "window": camera.window.tolist(),
        "resolution": [camera.width, camera.height],
    }


def _attributes(origin: Origin) -> dict[str, Any]:
    """Attributes of the header; `worldToCamera` is a standard one, of row vectors and a camera that looks along −z."""
    camera, world_to_camera = origin.camera, np.eye(4, dtype=np.float32)
    world_to_camera[:3, :3] = camera.axes
    world_to_camera[3, :3] = -camera.position @ camera.axes
    return {
        "worldToCamera": world_to_camera,
        "rsibr:camera": json.dumps(camera_record(camera)),
        "rsibr:bakes": json.dumps(dict(origin.bakes)),
        "rsibr:methods": json.dumps(dict(origin.methods)),
        "rsibr:settings": json.dumps(dict(origin.settings)),
        "rsibr:version": __version__,
    }


def _straight(picture: Picture) -> NDArray[np.floating]:
    """Radiance of the surfaces alone: not premultiplied."""
    return picture.radiance / np.maximum(picture.alpha, 1e-6)[..., None]
