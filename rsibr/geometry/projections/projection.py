"""Projections of the sphere of directions onto images, found by name.

A projection maps unit directions to points of one or several *sheets*: six faces of a cube, two disks, one
latitude–longitude picture. Every module of this package may register projections; no list of them stands elsewhere.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import cache
from typing import TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError, did_you_mean
from rsibr.geometry.projections.texel_axis import TexelAxis
from rsibr.registered import import_all

Place = tuple["mi.UInt32", "mi.Point2f"]
"""Sheet, and point in it."""

_ACROSS = 0.125  # texels beyond an edge at which its neighbour is looked for: well inside that texel


class Projection(ABC):
    """Mapping between unit directions and points of image sheets.

    Points `p` lie in [0, 1]², x right and y down. Texel centres lie at (i+½)/N, except on axes that are `on_edges`.

    Attributes
    ----------
    name : str
        Name in configs and in `projection`.
    sheets : int
        Number of images.
    aspect : float
        Usual ratio of columns to rows of a sheet.
    columns_on_edges, rows_on_edges : bool
        Whether the outer texel centres lie on the sheet's edges; see `TexelAxis`.
    is_square : bool
        Whether sheets have as many columns as rows.
    share : float
        Share of a sheet's area that shows directions.
    covers_sphere : bool
        Whether every direction has a place. If not, directions without one get the nearest place.
    """

    name: str
    sheets: int = 1
    aspect: float = 1.0
    columns_on_edges: bool = False
    rows_on_edges: bool = False
    is_square: bool = True
    share: float = 1.0
    covers_sphere: bool = True

    @abstractmethod
    def direction(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector3f:
        """Unit direction at a point of a sheet.

        Parameters
        ----------
        sheet : mi.UInt32
            Sheets, one a lane.
        p : mi.Point2f
            Points of [0, 1]². Points up to a texel outside continue on the neighbouring sheet.
        """

    @abstractmethod
    def place(self, d: mi.Vector3f) -> Place:
        """Sheet and point of a unit direction: the inverse of `direction`."""

    @abstractmethod
    def density(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Float:
        """Solid angle [sr] per unit of area of a sheet, at a point; 0 where the sheet shows no direction of its own."""

    @abstractmethod
    def solid_angles(self, columns: TexelAxis, rows: TexelAxis) -> NDArray[np.float64]:
        """Exact solid angle [sr] of each texel, shape (sheets, rows, columns)."""

    def axes(self, size: int | tuple[int, int]) -> tuple[TexelAxis, TexelAxis]:
        """Columns and rows of a sheet.

        Parameters
        ----------
        size : int or (int, int)
            Rows, from which the columns follow by `aspect`; or rows and columns.
        """
        height, width = (size, max(round(size * self.aspect), 1)) if isinstance(size, int) else size
        return TexelAxis(width, self.columns_on_edges), TexelAxis(height, self.rows_on_edges)

    def latlong_size(self, height: int, width: int) -> tuple[int, int]:
        """Rows and columns of a latitude–longitude image (Mitsuba's) that holds the detail of sheets of H × W texels.

        At its equator, texels are at most half as wide as those of the sheets on average.
        """
        mean = math.sqrt(4 * math.pi / (self.sheets * height * width * self.share))
        steps = 2 * math.ceil(math.pi / mean)
        return steps + 1, 2 * steps

    def bordered(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Add a border of one texel to each sheet, taken from across its edges, so that lookups have no seam.

        Parameters
        ----------
        values : ndarray, shape (F, H, W, C)
            Sheets.

        Returns
        -------
        ndarray, shape (F, H + 2, W + 2, C)
            The sheets in their borders. Where a texel shows no direction of its own (outside a disk), its value is
            replaced like those of the border.
        """
        sheets, height, width, channels = values.shape
        columns, rows = self.axes((height, width))
        inner = np.pad(values, ((0, 0), (1, 1), (1, 1), (0, 0)))
        frame = np.pad(np.zeros((sheets, height, width), bool), ((0, 0), (1, 1), (1, 1)), constant_values=True)
        sheet, row, column = np.nonzero(frame)
        # Just beyond the edge, and in the middle of the texel along it
        x = _near(column - 1, width) + columns.first
        y = _near(row - 1, height) + rows.first
        p = mi.Point2f((x / columns.scale).astype(np.float32), (y / rows.scale).astype(np.float32))
        source = self.texel_of(self.direction(mi.UInt32(sheet.astype(np.uint32)), p), columns, rows)
        inner[frame] = values.reshape(-1, channels)[np.array(source)]
        return inner

    def texel_of(self, d: mi.Vector3f, columns: TexelAxis, rows: TexelAxis) -> mi.UInt32:
        """Index of the texel nearest to a direction, row-major over sheet, row and column."""
        sheet, p = self.place(d)
        column = dr.clip(mi.Int32(dr.floor(p.x * columns.scale + (0.5 - columns.first))), 0, columns.count - 1)
        row = dr.clip(mi.Int32(dr.floor(p.y * rows.scale + (0.5 - rows.first))), 0, rows.count - 1)
        return (sheet * rows.count + mi.UInt32(row)) * columns.count + mi.UInt32(column)


def _near(index: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Place in texels: the centre, or just beyond the outer edge for −1 and `count`."""
    return np.clip(index, -0.5 - _ACROSS, count - 0.5 + _ACROSS)


_REGISTERED: dict[str, Projection] = {}
One = TypeVar("One", bound=Projection)


def register(one: One) -> One:
    """Register a projection under its name, and return it."""
    _REGISTERED[one.name] = one
    return one


def projection_names() -> tuple[str, ...]:
    """Names of all projections, sorted."""
    _discover()
    return tuple(sorted(_REGISTERED))


def projection(name: str) -> Projection:
    """Projection of a name.

    Raises
    ------
    InputError
        If there is none; the message lists all.

    Examples
    --------
    >>> projection("cube").sheets
    6
    """
    names = projection_names()
    if name not in names:
        fix = did_you_mean(name, names) + f"there are: {', '.join(names)}"
        raise InputError(f"unknown projection '{name}'", where="projection", fix=fix)
    return _REGISTERED[name]


@cache
def _discover() -> None:
    """Import every module of this package once; each registers its projections."""
    import_all("rsibr.geometry.projections")
