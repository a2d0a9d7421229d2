"""A projection in axes of its own, such as a mirror ball seen from any side, with directions in world coordinates."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.projection import Place, Projection
from rsibr.geometry.projections.texel_axis import TexelAxis


class Turned(Projection):
    """Another projection, turned.

    Parameters
    ----------
    inner : Projection
        The projection in its own axes.
    frame : ndarray, shape (3, 3)
        Those axes x, y, z in world coordinates, in columns; a rotation.

    Examples
    --------
    >>> from rsibr.geometry.projections.projection import projection
    >>> ball = Turned(projection("mirror-ball"), np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]))  # seen from +X
    >>> [round(float(x[0]), 3) for x in ball.direction(mi.UInt32(0), mi.Point2f(0.5, 0.5))]
    [1.0, 0.0, 0.0]
    """

    def __init__(self, inner: Projection, frame: NDArray[np.floating]) -> None:
        self.name, self.sheets, self.aspect = inner.name, inner.sheets, inner.aspect
        self.columns_on_edges, self.rows_on_edges = inner.columns_on_edges, inner.rows_on_edges
        self.is_square, self.share, self.covers_sphere = inner.is_square, inner.share, inner.covers_sphere
        self._inner = inner
        self._to_world = mi.Matrix3f(frame.tolist())
        self._from_world = mi.Matrix3f(frame.T.tolist())

    def direction(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector3f:  # noqa: D102
        return self._to_world @ self._inner.direction(sheet, p)

    def place(self, d: mi.Vector3f) -> Place:  # noqa: D102
        return self._inner.place(self._from_world @ d)

    def density(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Float:  # noqa: D102
        return self._inner.density(sheet, p)

    def solid_angles(self, columns: TexelAxis, rows: TexelAxis) -> NDArray[np.float64]:  # noqa: D102
        return self._inner.solid_angles(columns, rows)

    def latlong_size(self, height: int, width: int) -> tuple[int, int]:  # noqa: D102
        return self._inner.latlong_size(height, width)

    def bordered(self, values: NDArray[np.float32]) -> NDArray[np.float32]:  # noqa: D102
        return self._inner.bordered(values)
