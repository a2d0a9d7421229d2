"""Environment of a bake as an OpenEXR file; see `rsibr.light.radiance`.

The first part is the octahedral image. If the material has a delta lobe and the environment is an image, that is the
second part, with its axes (`rsibr:frame`, m33f, columns x, y, z in world coordinates).
"""

from __future__ import annotations

import contextlib
import io
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from rsibr.errors import BakeError
from rsibr.light.radiance import Light
from rsibr.store.map_file import FRAME_KEY, REC709

LIGHT_NAME = "light.exr"

_PICTURE, _IMAGE = "light", "image"


def encode_light(light: Light) -> bytes:
    """Bytes of the file: R, G, B, float32, ZIP; equal environments give equal bytes."""
    images = {_PICTURE: light.picture} | ({} if light.image is None else {_IMAGE: light.image})
    header = {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "chromaticities": REC709,
        "software": "rsibr",
        "displayWindow": _window(*np.max([image.shape for image in images.values()], axis=0)[:2]),  # one for all parts
    }
    own = {_IMAGE: {FRAME_KEY: np.ascontiguousarray(light.frame, np.float32)}}
    parts = [
        OpenEXR.Part(
            {**header, **own.get(name, {}), "dataWindow": _window(*image.shape[:2])},
            {"RGB": np.ascontiguousarray(image)},
            name,
        )
        for name, image in images.items()
    ]
    stream = io.BytesIO()
    with OpenEXR.File(parts) as file:
        file.write(stream)
    return stream.getvalue()


def decode_light(data: bytes, where: str) -> Light:
    """Decode a file of `encode_light`; `where` names the file in an error.

    Raises
    ------
    BakeError
        If the bytes are not such a file, or are truncated or altered.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()), OpenEXR.File(io.BytesIO(data)) as file:
            picture, *images = [_pixels(part) for part in file.parts]
            frames = [np.array(part.header[FRAME_KEY], np.float64) for part in file.parts[1:]]
        if picture.shape[0] != picture.shape[1] or len(images) > 1:
            raise ValueError(f"{picture.shape} and {len(images)} images")
    except (KeyError, RuntimeError, ValueError, TypeError, OSError, AttributeError) as error:
        raise BakeError("is no light of rsibr, or is truncated or altered", where=where) from error
    return Light(picture, images[0], frames[0]) if images else Light(picture)


def _window(height: int, width: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    return np.zeros(2, np.int32), np.array([width - 1, height - 1], np.int32)


def _pixels(part: Any) -> NDArray[np.float32]:
    pixels: NDArray[np.float32] = part.channels["RGB"].pixels
    if pixels.ndim != 3 or pixels.dtype != np.float32:
        raise ValueError(f"{pixels.dtype} {pixels.shape}")
    return pixels
