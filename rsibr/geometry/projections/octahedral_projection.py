"""The octahedral map as a projection: one square sheet; formulas in `rsibr.geometry.projections.octahedral`."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral import direction_from_square, square_from_direction, texel_solid_angles
from rsibr.geometry.projections.projection import Place, Projection, register
from rsibr.geometry.projections.texel_axis import TexelAxis


class Octahedral(Projection):
    """Octahedron folded open into a square: +Z in the middle, −Z in the corners, +X on the right, +Y at the top."""

    name = "octahedral"

    def direction(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector3f:  # noqa: D102, ARG002
        return direction_from_square(mi.Point2f(2 * p.x - 1, 1 - 2 * p.y))

    def place(self, d: mi.Vector3f) -> Place:  # noqa: D102
        q = square_from_direction(d)
        return mi.UInt32(0), mi.Point2f(0.5 + 0.5 * q.x, 0.5 - 0.5 * q.y)

    def density(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Float:  # noqa: D102
        size = dr.abs(self.direction(sheet, p))
        sum_of_sizes = size.x + size.y + size.z
        return 4 * sum_of_sizes * sum_of_sizes * sum_of_sizes

    def solid_angles(self, columns: TexelAxis, rows: TexelAxis) -> NDArray[np.float64]:
        """Solid angles by the density at the centres, scaled to 4π; the sheet is square."""
        if columns.count != rows.count:
            raise ValueError(f"an octahedral map is square, not {columns.count} × {rows.count}")
        return texel_solid_angles(rows.count).reshape(1, rows.count, columns.count)


OCTAHEDRAL = register(Octahedral())
"""Praun & Hoppe (2003)."""
