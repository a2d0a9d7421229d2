"""Six face files with known content, written by the table of directions, without the code under test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.scene.maps import BLOBS, write_exr

DIRECTIONS: dict[str, Callable[..., list]] = {
    "px": lambda x, y: [1 + 0 * x, y, -x],
    "nx": lambda x, y: [-1 + 0 * x, y, x],
    "py": lambda x, y: [x, 1 + 0 * x, -y],
    "ny": lambda x, y: [x, -1 + 0 * x, y],
    "pz": lambda x, y: [x, y, 1 + 0 * x],
    "nz": lambda x, y: [-x, y, -1 + 0 * x],
}
"""World direction at X right and Y up in a face, −1 … 1."""


def light(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smooth radiance (…, 3) that shows every turn and mirroring: a light at each of `BLOBS`."""
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    blobs = [np.exp(4.0 * (directions @ np.array(axis) - 1.0))[..., None] * rgb for axis, rgb in BLOBS.items()]
    return 0.05 + np.sum(blobs, axis=0)


def face(name: str, side: int) -> NDArray[np.float64]:
    """Image (N, N, 3) of a face, texel centres at (i+½)/N."""
    place = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    x, y = np.meshgrid(place, -place)
    return light(np.stack(DIRECTIONS[name](x, y), axis=-1))


def write_faces(folder: Path, side: int = 32) -> dict[str, Path]:
    """Write sky_px.exr … sky_nz.exr."""
    return {name: write_exr(folder / f"sky_{name}.exr", face(name, side)) for name in DIRECTIONS}
