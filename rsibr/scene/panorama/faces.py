"""Six pictures that are the faces of a cube."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.geometry.projections.faces import FACES


def stacked_faces(images: Mapping[str, NDArray[np.float32]], paths: Mapping[str, Path]) -> NDArray[np.float32]:
    """Faces as sheets of a cube.

    Parameters
    ----------
    images : dict of str to ndarray (N, N, 3)
        The six faces by name.
    paths : dict of str to Path
        Their files, which errors name.

    Returns
    -------
    ndarray (6, N, N, 3)

    Raises
    ------
    InputError
        If a face is not square, or has another size than the first.
    """
    side = images[FACES[0]].shape[0]
    for face in FACES:
        height, width = images[face].shape[:2]
        if height != width:
            raise InputError(f"face {face} has {width} × {height} texels: it is not square", where=str(paths[face]))
        if height != side:
            raise InputError(
                f"face {face} has {width} × {height} texels, face {FACES[0]} has {side} × {side}",
                where=str(paths[face]),
                fix="save all six in one size",
            )
    return np.stack([images[face] for face in FACES])
