"""MIP levels of a cube whose faces are those of OpenGL, KTX and DDS, in float16."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.cube import CUBE
from rsibr.publishing.half_float import rgba, to_half
from rsibr.publishing.published_view import PublishedView

CONVENTION = (
    "Cube of OpenGL, Vulkan and Direct3D: faces +X -X +Y -Y +Z -Z, left-handed with +Y up, row 0 at the top; "
    "textureLod(cube, d) with a world direction d gives the radiance of d."
)
"""What files with a cube say about it."""


@dataclass(frozen=True, eq=False)
class CubeLevels:
    """Levels of a cube, the largest first.

    Attributes
    ----------
    levels : tuple of ndarray, shape (6, N_k, N_k, 4), float16
        Faces px, nx, py, ny, pz, nz (`rsibr.geometry.projections.cube`), row 0 at the top, alpha 1.
    notes : tuple of str
        Values that were clamped, of all levels.
    """

    levels: tuple[NDArray[np.float16], ...]
    notes: tuple[str, ...]

    @property
    def size(self) -> int:
        """Texels a side of the largest level."""
        return int(self.levels[0].shape[1])

    @classmethod
    def of(cls, levels: Sequence[NDArray[np.float32]]) -> CubeLevels:
        """Round levels of shape (6, N, N, 3) to float16."""
        _, notes = to_half(np.concatenate([level.ravel() for level in levels]))
        return cls(tuple(rgba(to_half(level)[0]) for level in levels), notes)

    @classmethod
    def of_view(cls, view: PublishedView, size: int) -> CubeLevels:
        """Levels of a view's reflection from `size` texels a side, a power of two, down to 1.

        Each texel of each level is the mean over its solid angle.
        """
        sizes = [size >> k for k in range(size.bit_length())]
        return cls.of([view.in_projection(CUBE, side) for side in sizes])
