"""The light of a bake as an OpenEXR file: what the model of a lobe is made from; see `rsibr.effects.light`."""

from __future__ import annotations

import contextlib
import io

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from rsibr.bake.map_file import REC709
from rsibr.errors import BakeError

LIGHT_NAME = "light.exr"


def encode_light(light: NDArray[np.float32]) -> bytes:
    """Bytes of the file: one part, R, G, B, float32, ZIP; equal lights give equal bytes.

    Parameters
    ----------
    light : ndarray, shape (R, R, 3), float32
        Octahedral picture of the radiance [W sr⁻¹ m⁻²].
    """
    header = {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "chromaticities": REC709,
        "software": "rsibr",
    }
    stream = io.BytesIO()
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(light)}) as file:
        file.write(stream)
    return stream.getvalue()


def decode_light(data: bytes, where: str) -> NDArray[np.float32]:
    """Inverse of `encode_light`; `where` names the file in an error.

    Raises
    ------
    BakeError
        If the bytes are no light of ours.
    """
    try:
        with contextlib.redirect_stdout(io.StringIO()), OpenEXR.File(io.BytesIO(data)) as file:
            light: NDArray[np.float32] = file.channels()["RGB"].pixels
        if light.ndim != 3 or light.shape[0] != light.shape[1] or light.dtype != np.float32:
            raise ValueError(f"{light.dtype} {light.shape}")
    except (KeyError, RuntimeError, ValueError, TypeError, OSError, AttributeError) as error:
        raise BakeError("is no light of rsibr, or is truncated or altered", where=where) from error
    return light
