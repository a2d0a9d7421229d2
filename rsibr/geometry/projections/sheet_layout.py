"""Layouts: how the sheets of a projection stand in one picture, as strips or as the cross of a cube."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.projection import Projection


@dataclass(frozen=True)
class SheetLayout:
    """Grid of cells, some with a sheet.

    Attributes
    ----------
    name : str
        For example "horizontal cross".
    down, across : int
        Rows and columns of cells.
    cells : tuple of (int, int)
        Row and column of each sheet.
    turned : tuple of int
        Sheets that stand upside down.
    """

    name: str
    down: int
    across: int
    cells: tuple[tuple[int, int], ...]
    turned: tuple[int, ...] = ()

    def split(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Cut a picture (H, W, C) into its sheets (F, h, w, C)."""
        height, width = picture.shape[0] // self.down, picture.shape[1] // self.across
        cut = [
            picture[row * height : (row + 1) * height, column * width : (column + 1) * width]
            for row, column in self.cells
        ]
        return np.stack([self._upright(sheet, one) for sheet, one in enumerate(cut)])

    def joined(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Put sheets (F, h, w, C) into a picture (H, W, C); cells without a sheet are 0."""
        _, height, width, channels = values.shape
        picture = np.zeros((self.down * height, self.across * width, channels), values.dtype)
        for sheet, (row, column) in enumerate(self.cells):
            place = slice(row * height, (row + 1) * height), slice(column * width, (column + 1) * width)
            picture[place] = self._upright(sheet, values[sheet])
        return picture

    def _upright(self, sheet: int, one: NDArray[np.float32]) -> NDArray[np.float32]:
        return one[::-1, ::-1] if sheet in self.turned else one


HORIZONTAL_CROSS = SheetLayout("horizontal cross", 3, 4, ((1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (1, 3)))
"""nx, pz, px, nz in the middle row, py above pz and ny below it."""

VERTICAL_CROSS = SheetLayout("vertical cross", 4, 3, ((1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (3, 1)), turned=(5,))
"""py, pz, ny, nz in the middle column, nx left of pz and px right of it; nz is upside down, so that edges meet."""


def layouts(projection: Projection) -> tuple[SheetLayout, ...]:
    """Layouts in which a picture can show a projection: no two have one aspect ratio.

    Examples
    --------
    >>> from rsibr.geometry.projections.projection import projection
    >>> [one.name for one in layouts(projection("dual-paraboloid"))]
    ['row', 'column']
    """
    count = projection.sheets
    if count == 1:
        return (SheetLayout("single", 1, 1, ((0, 0),)),)
    row = SheetLayout("row", 1, count, tuple((0, sheet) for sheet in range(count)))
    column = SheetLayout("column", count, 1, tuple((sheet, 0) for sheet in range(count)))
    return (row, column, *((HORIZONTAL_CROSS, VERTICAL_CROSS) if count == 6 else ()))


def layout_of(projection: Projection, height: int, width: int) -> SheetLayout | None:
    """Layout that a picture of H × W texels has, by its aspect ratio; None if it has none.

    Sheets are square, except those of latitude and longitude, which may have any shape.
    """
    for one in layouts(projection):
        is_whole = height % one.down == 0 and width % one.across == 0
        if is_whole and (not projection.is_square or height // one.down == width // one.across):
            return one
    return None
