"""Images of the sphere of directions in any projection: lookups across seams, conversion between projections."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.geometry.projections.projection import Projection
from rsibr.geometry.projections.texel_axis import TexelAxis

Size = int | tuple[int, int]
"""Rows of a sheet, from which the columns follow by the projection's aspect; or rows and columns."""

_FINENESS = 4
"""Samples along a side for each of the finest source texels, when a conversion minifies: fewer miss the tip of a lone
bright texel, or hit it too often."""

_FINEST, _WIDEST = 0.02, 0.9  # quantiles of the widths of source texels and of those of the result
_MOST_SAMPLES = 256  # a side of a texel
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


@dataclass(eq=False)
class SphereTexture:
    """Image of the sphere on the device; an argument that recorded kernels (`dr.freeze`) accept.

    Attributes
    ----------
    projection : Projection
        Where directions lie.
    texels : BorderedTexels
        Its sheets.
    """

    projection: Projection
    texels: BorderedTexels

    def lookup(self, d: mi.Vector3f) -> mi.Color3f:
        """Value in unit directions, interpolated bilinearly, across seams too."""
        value = self.texels.lookup(*self.projection.place(d))
        return mi.Color3f(value.x, value.y, value.z)

    def nearest(self, d: mi.Vector3f) -> mi.Color3f:
        """Value of the texel that holds each unit direction."""
        value = self.texels.nearest(*self.projection.place(d))
        return mi.Color3f(value.x, value.y, value.z)


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
        values = np.asarray(values, dtype=np.float32)
        if projection.share < 1:  # texels outside a disk
            values = projection.bordered(values)[:, 1:-1, 1:-1]
        self.projection = projection
        self.values = np.ascontiguousarray(values)

    @cached_property
    def texture(self) -> SphereTexture:
        """The image on the device, copied when it is first looked up."""
        return SphereTexture(self.projection, BorderedTexels.of(self.projection.bordered(self.values), *self.axes))

    @property
    def texels(self) -> BorderedTexels:
        """Sheets of `texture`."""
        return self.texture.texels

    @property
    def axes(self) -> tuple[TexelAxis, TexelAxis]:
        """Columns and rows of a sheet."""
        return self.projection.axes((self.values.shape[1], self.values.shape[2]))

    def lookup(self, d: mi.Vector3f) -> mi.Color3f:
        """Value in unit directions, interpolated bilinearly, across seams too."""
        return self.texture.lookup(d)

    def nearest(self, d: mi.Vector3f) -> mi.Color3f:
        """Value of the texel that holds each unit direction."""
        return self.texture.nearest(d)

    def mean(self) -> NDArray[np.float64]:
        """Mean value over the sphere, shape (3,)."""
        weights = self.projection.solid_angles(*self.axes)
        return np.asarray(np.einsum("fhw,fhwc->c", weights, self.values) / weights.sum())


def converted(image: SphereImage, to: Projection, size: Size, *, samples: int = 0) -> SphereImage:
    """Convert an image to another projection, or to another size.

    Parameters
    ----------
    image : SphereImage
        Image of the whole sphere.
    to : Projection
        Projection of the result.
    size : int or (int, int)
        Rows, or rows and columns, of a sheet of the result.
    samples : int
        Samples along a side of a texel; 0: as many as the sizes call for.

    Returns
    -------
    SphereImage
        Where texels of the result are larger than those of the source, means over their solid angle, of samples a
        quarter as far apart as the finest texels of the source; otherwise bilinear samples at their centres.

    Raises
    ------
    ValueError
        If the image shows a hemisphere only.
    """
    if not image.projection.covers_sphere:
        raise ValueError(f"{image.projection.name} shows a hemisphere: it cannot be converted")
    columns, rows = to.axes(size)
    if to is image.projection and (columns, rows) == image.axes:
        return image
    side = samples or _samples_a_side(image, to, columns, rows)
    count = to.sheets * rows.count * columns.count
    values, step = np.empty((count, 3), np.float32), max(_LANES // side**2, 1)
    for start in range(0, count, step):
        texel = dr.arange(mi.UInt32, min(step, count - start)) + dr.opaque(mi.UInt32, start)
        values[start : start + step] = np.array(_mean(image, to, columns, rows, texel, side)).T
    return SphereImage(to, values.reshape(to.sheets, rows.count, columns.count, 3))


def _mean(
    image: SphereImage, to: Projection, columns: TexelAxis, rows: TexelAxis, texel: mi.UInt32, side: int
) -> mi.Color3f:
    """Mean over texels from `side`² samples each, weighted by solid angle; the centre where they have none."""
    sheet, row, column = _split(texel, columns, rows)
    centre = image.lookup(to.direction(sheet, mi.Point2f(columns.place(column), rows.place(row))))
    if side == 1:
        return centre
    block = side * side
    sample = dr.arange(mi.UInt32, dr.width(texel) * block) % block
    sheet, row, column = (dr.repeat(one, block) for one in (sheet, row, column))
    x = _within(columns, column, (mi.Float(sample % side) + 0.5) / side)
    y = _within(rows, row, (mi.Float(sample // side) + 0.5) / side)
    p = mi.Point2f(x, y)
    weight = to.density(sheet, p)
    value = image.lookup(to.direction(sheet, p)) * weight
    total = dr.block_sum(weight, block)
    mean = mi.Color3f(*(dr.block_sum(channel, block) for channel in value)) / dr.maximum(total, 1e-30)
    return dr.select(total > 0, mean, centre)


def _samples_a_side(image: SphereImage, to: Projection, columns: TexelAxis, rows: TexelAxis) -> int:
    """Samples along a side of a texel: 1 if no texel of the result is wider than the source's texels mostly are."""
    wanted, given = _widths(to, columns, rows), _widths(image.projection, *image.axes)
    if wanted.max() < 1.001 * np.median(given):
        return 1
    finer = float(np.quantile(wanted, _WIDEST) / np.quantile(given, _FINEST))
    return min(math.ceil(_FINENESS * finer), _MOST_SAMPLES)


def _widths(to: Projection, columns: TexelAxis, rows: TexelAxis) -> NDArray[np.float32]:
    """Greater distance between opposite sides of each texel that shows directions of its own, as a chord."""
    sheet, row, column = _split(dr.arange(mi.UInt32, to.sheets * rows.count * columns.count), columns, rows)
    left, right, top, bottom = (
        to.direction(sheet, mi.Point2f(_within(columns, column, across), _within(rows, row, down)))
        for across, down in ((0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0))
    )
    chord = np.array(dr.maximum(dr.norm(right - left), dr.norm(bottom - top)))
    seen = np.array(to.density(sheet, mi.Point2f(columns.place(column), rows.place(row))) > 0)
    return chord[seen] if seen.any() else chord


def _split(index: mi.UInt32, columns: TexelAxis, rows: TexelAxis) -> tuple[mi.UInt32, mi.Float, mi.Float]:
    """Sheet, row and column of a texel's index."""
    line = index // columns.count
    return line // rows.count, mi.Float(line % rows.count), mi.Float(index % columns.count)


def _within(axis: TexelAxis, texel: mi.Float, share: mi.Float | float) -> mi.Float:
    """Coordinate at a share in [0, 1] of a texel's width."""
    low, high = dr.clip(axis.place(texel - 0.5), 0, 1), dr.clip(axis.place(texel + 0.5), 0, 1)
    return dr.lerp(low, high, share)
