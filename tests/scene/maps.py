"""Latitude–longitude maps with known content, for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.latlong import read_latlong

BLOBS = {
    (1.0, 0.0, 0.0): (4.0, 0.2, 0.2),
    (0.0, 0.0, 1.0): (0.2, 4.0, 0.2),
    (0.0, 1.0, 0.0): (0.2, 0.2, 4.0),
    (-0.6, -0.48, -0.64): (3.0, 3.0, 0.1),
}
"""Directions of lights, and their colours: no rotation and no mirror image of them looks the same."""


def latlong_directions(height: int, width: int) -> NDArray[np.float64]:
    """World directions (H, W, 3) of the texels, as Mitsuba's envmap lays them: rows from pole to pole, u=0 at −Z."""
    polar = np.pi * np.arange(height)[:, None] / (height - 1)
    azimuth = 2.0 * np.pi * (np.arange(width)[None, :] + 0.5) / width
    x, z = np.sin(polar) * np.sin(azimuth), -np.sin(polar) * np.cos(azimuth)
    return np.stack([x, np.broadcast_to(np.cos(polar), x.shape), z], axis=-1)


def gradient(axis: NDArray[np.float64], height: int = 257, width: int = 512) -> NDArray[np.float64]:
    """Radiance (H, W, 3) of L(ω) = 1 + a·ω; at this size bilinear interpolation errs by less than 4e-5."""
    return np.repeat(1.0 + latlong_directions(height, width) @ axis[:, None], 3, axis=2)


def asymmetric(height: int = 64, width: int = 128) -> NDArray[np.float64]:
    """Radiance (H, W, 3) of a smooth light at each of `BLOBS` over a dim grey."""
    directions = latlong_directions(height, width)
    image = np.full((height, width, 3), 0.05)
    for axis, colour in BLOBS.items():
        image += np.exp(20.0 * (directions @ np.array(axis) - 1.0))[..., None] * np.array(colour)
    return image


def write_exr(path: Path, image: NDArray[np.floating]) -> Path:
    """Write an RGB image as float32 EXR."""
    return write_channels(path, {"RGB": np.ascontiguousarray(image, dtype=np.float32)})


def write_channels(path: Path, channels: dict[str, NDArray[np.generic]], **header: object) -> Path:
    """Write an EXR with the channels as given."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))
    return path


def refusal(path: Path, **options: object) -> str:
    """Message of the one-line error with which a file is refused; it begins with the file's name."""
    with pytest.raises(InputError) as caught:
        read_latlong(path, **options)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert "\n" not in text
    return text
