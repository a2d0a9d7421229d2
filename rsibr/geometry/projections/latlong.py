"""Latitude–longitude projections: one class, a convention of axes and texel centres for each name.

θ = arccos y is the angle from +Y, and p_y = θ/π. The longitude starts at the axis `start` (p_x = 0) and passes the axis
`quarter` (p_x = ¼).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.projection import Place, Projection, register
from rsibr.geometry.projections.texel_axis import TexelAxis

_AXES = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}


class LatLong(Projection):
    """Latitude and longitude, north pole +Y.

    Parameters
    ----------
    name : str
        Name of the projection.
    start, quarter : {"+x", "-x", "+z", "-z"}
        Horizontal axes at p_x = 0 and p_x = ¼.
    columns_on_edges, rows_on_edges : bool
        See `Projection`.
    """

    aspect = 2.0
    is_square = False

    def __init__(
        self, name: str, start: str, quarter: str, *, columns_on_edges: bool = False, rows_on_edges: bool = False
    ) -> None:
        self.name = name
        self.columns_on_edges, self.rows_on_edges = columns_on_edges, rows_on_edges
        self._start, self._quarter = _AXES[start], _AXES[quarter]

    def direction(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector3f:  # noqa: D102, ARG002
        sin_theta, cos_theta = dr.sincos(dr.pi * p.y)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * p.x)
        (start_x, _, start_z), (quarter_x, _, quarter_z) = self._start, self._quarter
        x = cos_phi * start_x + sin_phi * quarter_x
        z = cos_phi * start_z + sin_phi * quarter_z
        return mi.Vector3f(sin_theta * x, cos_theta, sin_theta * z)

    def place(self, d: mi.Vector3f) -> Place:  # noqa: D102
        along_start = d.x * self._start[0] + d.z * self._start[2]
        along_quarter = d.x * self._quarter[0] + d.z * self._quarter[2]
        turn = dr.atan2(along_quarter, along_start) * dr.inv_two_pi
        theta = dr.atan2(dr.sqrt(d.x * d.x + d.z * d.z), d.y)
        return mi.UInt32(0), mi.Point2f(turn - dr.floor(turn), theta * dr.inv_pi)

    def density(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Float:  # noqa: D102, ARG002
        return 2 * dr.square(dr.pi) * dr.abs(dr.sin(dr.pi * p.y)) + 0 * p.x

    def latlong_size(self, height: int, width: int) -> tuple[int, int]:
        """As in `Projection`: a size at which every texel centre of the sheet is one of the image: nothing is lost.

        Except where the columns are no multiple of 4, by which the quarters of the longitude would fall on centres.
        """
        exact = not self.columns_on_edges and width % 4 == 0
        return height if self.rows_on_edges else 2 * height + 1, width if exact else 2 * width

    def solid_angles(self, columns: TexelAxis, rows: TexelAxis) -> NDArray[np.float64]:  # noqa: D102
        heights = -np.diff(np.cos(np.pi * rows.edges()))
        return np.asarray(np.outer(heights, 2 * np.pi * np.diff(columns.edges()))[None])


MITSUBA = register(LatLong("latlong", "-z", "+x", rows_on_edges=True))
"""Mitsuba's `envmap`: −Z, +X, +Z, −X at p_x = 0, ¼, ½, ¾; the first and last row lie on the poles, at j/(H−1)."""

OPENEXR = register(LatLong("latlong-openexr", "-z", "+x", columns_on_edges=True, rows_on_edges=True))
"""OpenEXR's attribute `envmap = latlong`: as Mitsuba's, but the first and the last column both show −Z."""

FILAMENT = register(LatLong("latlong-filament", "-z", "-x"))
"""Filament's `cmgen --no-mirror`, cmft, PlayCanvas: −Z, −X, +Z, +X, mirrored as seen from inside."""

DEBEVEC = register(LatLong("latlong-debevec", "+z", "-x"))
"""Debevec's light probe gallery: +Z, −X, −Z, +X, so that −Z is in the middle and +X right of it."""

THREE = register(LatLong("latlong-three", "-x", "-z"))
"""three.js, glTF viewers, Blender after its change to +Y up: −X, −Z, +X, +Z, so that +X is in the middle."""

POLAR = register(LatLong("polar", "+z", "+x"))
"""Miller & Hoffman (1984), section 4.3: u = arctan(x, z), v = arccos y; +Z, +X, −Z, −X; texels centred."""
