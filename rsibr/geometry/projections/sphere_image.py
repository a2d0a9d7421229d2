"""Images of the whole sphere of directions in any projection: lookups across seams, and conversion between projections."""

from __future__ import annotations

import math
from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.geometry.projections.projection import Projection
from rsibr.geometry.projections.texel_axis import TexelAxis

Size = int | tuple[int, int]
"""Rows of a sheet, from which the columns follow by the projection's aspect; or rows and columns."""

_FINENESS = 2
"""Samples for each source texel, along a side, when a conversion minifies."""

_MOST_SAMPLES = 64  # a side of a texel
_LANES = 2**22  # samples at once


def texel_directions(projection: Projection, size: Size) -> mi.Vector3f:
    """Unit directions of the texels' centres, row-major over sheet, row and column.

    Parameters
    ----------
    projection : Projection
        The projection; where it is a disk, texels outside continue on the other side of its rim.
    size : int or (int, int)
        Rows, or rows and columns, of a sheet.
    """
    columns, rows = projection.axes(size)
    sheet, row, column = _split(dr.arange(mi.UInt32, projection.sheets * rows.count * columns.count), columns, rows)
    return projection.direction(sheet, mi.Point2f(columns.place(column), rows.place(row)))


def texel_solid_angles(projection: Projection, size: Size) -> NDArray[np.float64]:
    """Solid angles [sr] of the texels, shape (F, H, W); parameters as in `texel_directions`.

    They sum to 4π, or to 2π for a hemisphere. Of a texel cut by the rim of a disk only the part inside counts.
    """
    return projection.solid_angles(*projection.axes(size))


class SphereImage:
    """Image of the sphere of directions, on the host and on the device.

    Parameters
    ----------
    projection : Projection
        Where directions lie.
    values : ndarray, shape (F, H, W, 3)
        Value of each texel, for example radiance [W sr⁻¹ m⁻²]. Texels with their centre outside a disk are replaced by
        what lies on the other side of its rim.

    Attributes
    ----------
    projection : Projection
        As given.
    values : ndarray, shape (F, H, W, 3), float32
        Value of each texel.
    texels : BorderedTexels
        The same on the device.

    Examples
    --------
    >>> from rsibr.geometry.projections.projection import projection
    >>> grey = SphereImage(projection("cube"), np.full((6, 4, 4, 3), 0.5, dtype=np.float32))
    >>> grey.lookup(mi.Vector3f(0, 1, 0))
    [[0.5, 0.5, 0.5]]
    """

    def __init__(self, projection: Projection, values: NDArray[np.floating]) -> None:
        if values.ndim != 4 or (values.shape[0], values.shape[3]) != (projection.sheets, 3):
            raise ValueError(f"{projection.name} takes values ({projection.sheets}, H, W, 3), not {values.shape}")
        framed = projection.bordered(np.asarray(values, dtype=np.float32))
        self.projection = projection
        self.values = np.ascontiguousarray(framed[:, 1:-1, 1:-1])
        self.texels = BorderedTexels.of(framed, *self.axes)

    @property
    def axes(self) -> tuple[TexelAxis, TexelAxis]:
        """Columns and rows of a sheet."""
        return self.projection.axes((self.values.shape[1], self.values.shape[2]))

    def lookup(self, d: mi.Vector3f) -> mi.Color3f:
        """Value in unit directions, interpolated bilinearly, across seams too."""
        value = self.texels.lookup(*self.projection.place(d))
        return mi.Color3f(value.x, value.y, value.z)

    def nearest(self, d: mi.Vector3f) -> mi.Color3f:
        """Value of the texel nearest to each unit direction."""
        value = self.texels.nearest(*self.projection.place(d))
        return mi.Color3f(value.x, value.y, value.z)

    def mean(self) -> NDArray[np.float64]:
        """Mean value over the sphere, shape (3,)."""
        weights = self.projection.solid_angles(*self.axes)
        return np.asarray(np.einsum("fhw,fhwc->c", weights, self.values) / weights.sum())


def converted(image: SphereImage, to: Projection, size: Size) -> SphereImage:
    """Convert an image to another projection, or to another size.

    Parameters
    ----------
    image : SphereImage
        Image of the whole sphere.
    to : Projection
        Projection of the result.
    size : int or (int, int)
        Rows, or rows and columns, of a sheet of the result.

    Returns
    -------
    SphereImage
        Where its texels are larger than those of the source, their means over the solid angle, from samples half as far
        apart as the source's texels; where they are smaller, bilinear samples at their centres.
    """
    if not image.projection.covers_sphere:
        raise ValueError(f"{image.projection.name} holds a hemisphere: it cannot be converted")
    columns, rows = to.axes(size)
    if to is image.projection and (columns, rows) == image.axes:
        return image
    centres = np.array(image.lookup(texel_directions(to, size)), dtype=np.float32).T
    side = _samples_a_side(image, to, columns, rows)
    if side > 1:
        total = np.concatenate(list(_weighted(image, to, columns, rows, side)))
        covered = total[:, 3] > 0
        centres[covered] = total[covered, :3] / total[covered, 3:]
    return SphereImage(to, centres.reshape(to.sheets, rows.count, columns.count, 3))


def _samples_a_side(image: SphereImage, to: Projection, columns: TexelAxis, rows: TexelAxis) -> int:
    """Samples along a side of a texel: 1 where all texels of the result are smaller than half of the source's are."""
    source = np.sqrt(np.median(image.projection.solid_angles(*image.axes)))
    ratio = _widest(to, columns, rows) / source
    return 1 if ratio <= 1 else min(math.ceil(_FINENESS * ratio), _MOST_SAMPLES)


def _widest(to: Projection, columns: TexelAxis, rows: TexelAxis) -> float:
    """Greatest angle [rad] between opposite sides of a texel."""
    sheet, row, column = _split(dr.arange(mi.UInt32, to.sheets * rows.count * columns.count), columns, rows)
    ends = [
        [_within(columns, column, across), _within(rows, row, down)]
        for across, down in ((0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0))
    ]
    left, right, top, bottom = (to.direction(sheet, mi.Point2f(*end)) for end in ends)
    chord = dr.maximum(dr.norm(right - left), dr.norm(bottom - top))
    seen = to.density(sheet, mi.Point2f(columns.place(column), rows.place(row))) > 0
    return float(np.array(dr.max(dr.select(seen, chord, 0))).item())


def _weighted(
    image: SphereImage, to: Projection, columns: TexelAxis, rows: TexelAxis, side: int
) -> Iterator[NDArray[np.float64]]:
    """Sums over the samples of each texel of value times solid angle, and of solid angle; (texels, 4) at a time."""
    count, block = to.sheets * rows.count * columns.count, side * side
    step = max(_LANES // block, 1)
    for start in range(0, count, step):
        lanes = dr.arange(mi.UInt32, min(step, count - start) * block)
        texel, sample = lanes // block + dr.opaque(mi.UInt32, start), lanes % block
        sheet, row, column = _split(texel, columns, rows)
        x = _within(columns, column, (mi.Float(sample % side) + 0.5) / side)
        y = _within(rows, row, (mi.Float(sample // side) + 0.5) / side)
        p = mi.Point2f(x, y)
        weight = to.density(sheet, p)
        value = image.lookup(to.direction(sheet, p)) * weight
        sums = dr.block_sum(mi.Vector4f(value.x, value.y, value.z, weight), block)
        yield np.array(sums, dtype=np.float64).T


def _split(index: mi.UInt32, columns: TexelAxis, rows: TexelAxis) -> tuple[mi.UInt32, mi.Float, mi.Float]:
    """Sheet, row and column of a texel's index."""
    line = index // columns.count
    return line // rows.count, mi.Float(line % rows.count), mi.Float(index % columns.count)


def _within(axis: TexelAxis, texel: mi.Float, share: mi.Float | float) -> mi.Float:
    """Coordinate at a share in [0, 1] of a texel's width."""
    low, high = dr.clip(axis.place(texel - 0.5), 0, 1), dr.clip(axis.place(texel + 0.5), 0, 1)
    return dr.lerp(low, high, share)
