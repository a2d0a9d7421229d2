"""Stored maps on the device, for bilinear lookups anywhere in the disk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from rsibr.errors import MachineError
from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.to_device import to_device
from rsibr.light.shared_exponent import bilinear, packed

_T = TypeVar("_T", bound=np.generic)

MAX_WORDS = 2**32 - 1
"""Largest number of entries of a Dr.Jit array."""

_WORDS = 2  # 32-bit words a texel
_STRIP = 8  # texels across a strip: 64 bytes, one cache line
_BORDER = 1
_AROUND = ((_BORDER, _BORDER), (_BORDER, _BORDER), (0, 0))


@dataclass
class StoredView:
    """Index and frame of a stored view, one a lane or one for all lanes.

    Attributes
    ----------
    index : mi.UInt32
        Index of the stored map.
    x, y, v : mi.Vector3f
        Columns of its frame in world coordinates: right, up, and direction to the viewer.
    """

    index: mi.UInt32
    x: mi.Vector3f
    y: mi.Vector3f
    v: mi.Vector3f

    def to_local(self, direction: mi.Vector3f) -> mi.Vector3f:
        """Transform a direction from world coordinates to the frame of the stored view: T_s⁻¹."""
        return mi.Vector3f(dr.dot(self.x, direction), dr.dot(self.y, direction), dr.dot(self.v, direction))


@dataclass
class SourceMaps:
    """Radiance maps of all stored views.

    Attributes
    ----------
    texels : mi.Float
        Texels of all maps, flat: two words a texel with shared exponent (`rsibr.light.shared_exponent`), gathered as
        one aligned packet. Each map has a border of one texel and is stored in vertical strips of `_STRIP` texels, row
        by row.
    frames : mi.Float
        Frame of each view, nine floats each: columns x, y, z in world coordinates.
    half : mi.Float
        Half the texels a side. Opaque, as are the next two, so that maps of another size share a kernel.
    strip_size, map_size : mi.UInt32
        Texels a strip, and texels a map with its border.
    """

    texels: mi.Float
    frames: mi.Float
    half: mi.Float
    strip_size: mi.UInt32
    map_size: mi.UInt32

    @classmethod
    def from_arrays(
        cls, radiance: NDArray[np.float32], coverage: NDArray[np.float32], frames: NDArray[np.float64]
    ) -> SourceMaps:
        """Put maps on the device.

        Parameters
        ----------
        radiance : ndarray, shape (N, H, H, 3)
            Radiance [W sr⁻¹ m⁻²], coverage divided out. Texels without coverage are ignored.
        coverage : ndarray, shape (N, H, H)
            Share of each texel inside the disk.
        frames : ndarray, shape (N, 3, 3)
            Columns x, y, z in world coordinates.

        Raises
        ------
        MachineError
            If the maps exceed the size of one Dr.Jit array.
        """
        count, resolution = radiance.shape[:2]
        stride, strips = _strips(resolution)
        if not fits_device_array(count, resolution):
            raise MachineError(
                f"{count} maps of {resolution}² do not fit into one device array",
                fix="lower the resolution or the views",
            )
        texels = np.empty((count, strips, stride, _STRIP, _WORDS), dtype=np.uint32)
        for image, covered, texel in zip(radiance, coverage > 0, texels, strict=True):
            filled = packed(filled_outward(np.pad(image, _AROUND), np.pad(covered, _BORDER)))
            whole = np.pad(filled, ((0, 0), (0, strips * _STRIP - stride), (0, 0)))
            texel[:] = whole.reshape(stride, strips, _STRIP, _WORDS).swapaxes(0, 1)
        return cls(
            texels=to_device(mi.Float, texels.view(np.float32)),
            frames=to_device(mi.Float, np.swapaxes(frames, 1, 2).astype(np.float32)),
            half=dr.opaque(mi.Float, resolution / 2),
            strip_size=dr.opaque(mi.UInt32, stride * _STRIP),
            map_size=dr.opaque(mi.UInt32, strips * stride * _STRIP),
        )

    @classmethod
    def none(cls) -> SourceMaps:
        """Return one black texel, for a method without maps; kernels cannot take empty arrays."""
        return cls.from_arrays(np.zeros((1, 1, 1, 3), np.float32), np.ones((1, 1, 1), np.float32), np.eye(3)[None])

    def view(self, index: mi.UInt32) -> StoredView:
        """Fetch the stored view `index` with its frame, one a lane."""
        x, v = (dr.gather(mi.Vector3f, self.frames, 3 * index + axis) for axis in (0, 2))
        return StoredView(index, x, dr.cross(v, x), v)  # fetching y as well would take longer

    def fetch(self, view: mi.UInt32, p: mi.Point2f) -> mi.Color3f:
        """Bilinear lookup in the map of a stored view.

        Parameters
        ----------
        view : mi.UInt32
            Index of the view.
        p : mi.Point2f
            Points of the closed unit disk; never NaN.

        Returns
        -------
        mi.Color3f
            Radiance [W sr⁻¹ m⁻²].
        """
        cell = BilinearCell.in_sphere_map(p, self.half)
        first = dr.fma(view, self.map_size, cell.top * _STRIP)
        left, right = first + self._across(cell.left), first + self._across(cell.left + 1)
        return bilinear(self.texels, cell, left, right, _STRIP)

    def _across(self, column: mi.UInt32) -> mi.UInt32:
        """Offset of a column's first texel in its map."""
        return dr.fma(column // _STRIP, self.strip_size, column % _STRIP)


def fits_device_array(count: int, resolution: int) -> bool:
    """Whether so many maps, of `resolution` texels a side, can be put on the device."""
    stride, strips = _strips(resolution)
    return _WORDS * count * strips * stride * _STRIP <= MAX_WORDS


def _strips(resolution: int) -> tuple[int, int]:
    """Texels down a map with its border, and number of strips."""
    stride = resolution + 2 * _BORDER
    return stride, -(-stride // _STRIP)


def filled_outward(image: NDArray[_T], covered: NDArray[np.bool_]) -> NDArray[_T]:
    """Extend values to texels outside the disk from the nearest one inside; otherwise lookups at the rim darken.

    Parameters
    ----------
    image : ndarray, shape (H, W, …)
        Values of texels; those that are not covered are ignored.
    covered : ndarray, shape (H, W)
        Texels that hold a value, at least one.
    """
    row, column = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return np.asarray(image[row, column])
