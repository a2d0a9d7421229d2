"""One axis of a sheet of texels: where the texels' centres and edges lie."""

from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class TexelAxis:
    """Columns or rows of a sheet, over [0, 1].

    Attributes
    ----------
    count : int
        Number of texels, N.
    on_edges : bool
        Whether the first and the last centre lie at 0 and 1, the others at i/(N−1), and the first and last texel are
        half as wide. Otherwise centres lie at (i+½)/N.
    """

    count: int
    on_edges: bool = False

    @property
    def scale(self) -> int:
        """Texels per unit."""
        return max(self.count - 1, 1) if self.on_edges else self.count

    @property
    def first(self) -> float:
        """Place of the first centre, in texels."""
        return 0.0 if self.on_edges and self.count > 1 else 0.5

    def edges(self) -> NDArray[np.float64]:
        """Boundaries between texels, shape (N+1,), from 0 to 1.

        Examples
        --------
        >>> TexelAxis(3, on_edges=True).edges().tolist()
        [0.0, 0.25, 0.75, 1.0]
        """
        return np.clip((np.arange(self.count + 1) - 0.5 + self.first) / self.scale, 0.0, 1.0)

    def centres(self) -> NDArray[np.float64]:
        """Centres of the texels, shape (N,)."""
        return np.asarray((np.arange(self.count) + self.first) / self.scale)

    def place(self, texel: mi.Float) -> mi.Float:
        """Coordinate in [0, 1] of a place in texels, in which whole numbers are centres."""
        return (texel + self.first) / self.scale
