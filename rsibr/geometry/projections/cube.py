"""Cube projections: perspective projection onto six square faces.

The faces (`rsibr.geometry.projections.faces`) are those of OpenGL, KTX and DDS: with X right and Y up in a face, px is
(1, Y, −X), nx (−1, Y, X), py (X, 1, −Y), ny (X, −1, Y), pz (X, Y, 1), nz (−X, Y, −1).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.projection import Place, Projection, register
from rsibr.geometry.projections.texel_axis import TexelAxis

DENSITY = 2
"""Texels of a latitude–longitude image made from a cube for each texel amid a face, along a side."""

_RIGHT = ((0, 0, -1), (0, 0, 1), (1, 0, 0), (1, 0, 0), (1, 0, 0), (-1, 0, 0))
_UP = ((0, 1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1), (0, 1, 0), (0, 1, 0))
_FORWARD = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))


class Cube(Projection):
    """Six faces.

    Parameters
    ----------
    name : str
        Name of the projection.
    right, up : tuple of six triples
        World direction of each face's right and up.
    on_edges : bool
        Whether the outer texel centres lie on the edges of the cube.
    """

    sheets = 6

    def __init__(
        self,
        name: str,
        right: tuple[tuple[int, int, int], ...] = _RIGHT,
        up: tuple[tuple[int, int, int], ...] = _UP,
        *,
        on_edges: bool = False,
    ) -> None:
        self.name = name
        self.columns_on_edges = self.rows_on_edges = on_edges
        self._right, self._up = right, up

    def direction(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector3f:  # noqa: D102
        u, v = 2 * p.x - 1, 1 - 2 * p.y
        right, up, forward = (_of_face(sheet, table) for table in (self._right, self._up, _FORWARD))
        return dr.normalize(right * u + up * v + forward)

    def place(self, d: mi.Vector3f) -> Place:  # noqa: D102
        size = dr.abs(d)
        is_y = (size.y > size.x) & (size.y >= size.z)
        is_z = (size.z > size.x) & (size.z > size.y)
        along = dr.select(is_z, d.z, dr.select(is_y, d.y, d.x))
        sheet = dr.select(is_z, mi.UInt32(4), dr.select(is_y, mi.UInt32(2), mi.UInt32(0)))
        sheet += dr.select(along < 0, mi.UInt32(1), mi.UInt32(0))
        shrink = dr.rcp(dr.abs(along))
        u = dr.dot(_of_face(sheet, self._right), d) * shrink
        v = dr.dot(_of_face(sheet, self._up), d) * shrink
        return sheet, mi.Point2f(0.5 + 0.5 * u, 0.5 - 0.5 * v)

    def density(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Float:  # noqa: D102, ARG002
        nearness = dr.rsqrt(1 + dr.square(2 * p.x - 1) + dr.square(2 * p.y - 1))
        return 4 * nearness * nearness * nearness

    def latlong_size(self, height: int, width: int) -> tuple[int, int]:  # noqa: ARG002
        """As in `Projection`: texels half as wide as those amid a face, (4N+1, 8N) for N² texels a face.

        With centres on the edges N−1 takes the place of N.
        """
        steps = max(height - 1, 1) if self.rows_on_edges else height
        return 2 * DENSITY * steps + 1, 4 * DENSITY * steps

    def solid_angles(self, columns: TexelAxis, rows: TexelAxis) -> NDArray[np.float64]:
        """Exact solid angles: differences of arctan(uv/√(1+u²+v²)), that of a rectangle from the face's centre."""
        u, v = np.meshgrid(2 * columns.edges() - 1, 2 * rows.edges() - 1)
        corner = np.arctan2(u * v, np.sqrt(1 + u * u + v * v))
        face = corner[1:, 1:] - corner[1:, :-1] - corner[:-1, 1:] + corner[:-1, :-1]
        return np.repeat(face[None], 6, axis=0)

    def bordered(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """As in `Projection`; at a corner of the cube, where three faces meet, the mean of their three texels.

        A face of one texel with its centre on the edges is constant.
        """
        if self.rows_on_edges and values.shape[1] == 1:
            return np.pad(values, ((0, 0), (1, 1), (1, 1), (0, 0)), mode="edge")
        framed = super().bordered(values)
        for row, inner_row in ((0, 1), (-1, -2)):
            for column, inner_column in ((0, 1), (-1, -2)):
                three = framed[:, inner_row, column], framed[:, row, inner_column], framed[:, inner_row, inner_column]
                framed[:, row, column] = np.mean(three, axis=0)
        return framed


def _of_face(sheet: mi.UInt32, table: tuple[tuple[int, int, int], ...]) -> mi.Vector3f:
    """Row of a table for each face, without a gather."""
    chosen = mi.Vector3f(*table[0])
    for face in range(1, 6):
        chosen = dr.select(sheet == face, mi.Vector3f(*table[face]), chosen)
    return chosen


CUBE = register(Cube("cube"))
"""Six faces as in the module's head, texels centred."""

OPENEXR = register(
    Cube(
        "cube-openexr",
        right=((0, 0, 1), (0, 0, -1), (1, 0, 0), (1, 0, 0), (-1, 0, 0), (1, 0, 0)),
        up=((0, 1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (0, 1, 0), (0, 1, 0)),
        on_edges=True,
    )
)
"""OpenEXR's attribute `envmap = cube`: seen from inside, and the outer texel centres on the cube's edges."""
