"""The stored maps on the device, ready to be looked up at any point of the disk."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from rsibr.errors import MachineError
from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.to_device import to_device
from rsibr.light.shared_exponent import bilinear, packed

MAX_WORDS = 2**32 - 1
"""Entries that a Dr.Jit array can index."""

_WORDS = 2  # a texel
_STRIP = 8  # texels across a strip: 64 bytes, a line of the cache
_BORDER = 1
_AROUND = ((_BORDER, _BORDER), (_BORDER, _BORDER), (0, 0))


@dataclass
class StoredView:
    """One stored view a lane (or one for all lanes): which map it is, and its frame.

    Attributes
    ----------
    index : mi.UInt32
        Which of the stored maps.
    x, y, v : mi.Vector3f
        Columns of its frame in world coordinates: right, up, and the direction to the viewer.
    """

    index: mi.UInt32
    x: mi.Vector3f
    y: mi.Vector3f
    v: mi.Vector3f

    def to_local(self, direction: mi.Vector3f) -> mi.Vector3f:
        """World direction in the frame of the stored view: T_s⁻¹."""
        return mi.Vector3f(dr.dot(self.x, direction), dr.dot(self.y, direction), dr.dot(self.v, direction))


@dataclass
class SourceMaps:
    """Radiance maps of all stored views.

    Attributes
    ----------
    texels : mi.Float
        Texels of all maps, flat: bits of two words a texel (see `texel`), gathered as one aligned packet. Each map has
        a border of one texel, and is laid out in upright strips of `_STRIP` texels, row after row of each.
    frames : mi.Float
        Frame of each view, nine floats each, columns first: x, y, z in world coordinates.
    half : mi.Float
        Half the texels a side (opaque, as are the next two: maps of another size need no other kernel).
    strip_size, map_size : mi.UInt32
        Texels a strip, and a map with its border.
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
            Radiance [W sr⁻¹ m⁻²] with the coverage divided out. Texels without coverage are never read.
        coverage : ndarray, shape (N, H, H)
            Share of each texel inside the disk.
        frames : ndarray, shape (N, 3, 3)
            Columns x, y, z in world coordinates.
        """
        count, resolution = radiance.shape[:2]
        stride = resolution + 2 * _BORDER
        strips = -(-stride // _STRIP)
        if _WORDS * count * strips * stride * _STRIP > MAX_WORDS:
            raise MachineError(
                f"{count} maps of {resolution}² do not fit into one device array",
                fix="lower the resolution or the views",
            )
        texels = np.empty((count, strips, stride, _STRIP, _WORDS), dtype=np.uint32)
        for image, covered, texel in zip(radiance, coverage > 0, texels, strict=True):
            filled = packed(_filled_outward(np.pad(image, _AROUND), np.pad(covered, _BORDER)))
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
        """Return one black texel: for a method that looks no map up, or none yet. A kernel cannot hold empty arrays."""
        return cls.from_arrays(np.zeros((1, 1, 1, 3), np.float32), np.ones((1, 1, 1), np.float32), np.eye(3)[None])

    def view(self, index: mi.UInt32) -> StoredView:
        """Look up the frame of the stored view `index`, one a lane."""
        x, y, v = (dr.gather(mi.Vector3f, self.frames, 3 * index + axis) for axis in range(3))
        return StoredView(index, x, y, v)

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
        """Place of a column's first texel in its map."""
        return dr.fma(column // _STRIP, self.strip_size, column % _STRIP)


def _filled_outward(image: NDArray[np.float32], covered: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Give each texel outside the disk the value of the nearest one inside, so that no lookup at the rim darkens."""
    row, column = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return np.asarray(image[row, column])
