"""The stored maps on the device, ready to be looked up at any point of the disk."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from rsibr.errors import MachineError
from rsibr.geometry.resident import resident
from rsibr.reconstruct.texel import packed, unpacked

MAX_WORDS = 2**32 - 1
"""Entries that a Dr.Jit array can index."""

_WORDS = 2  # a texel
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
    texels : mi.UInt32
        Texels of all maps, each map with a border of one texel, flat: two words a texel (see `texel`), which are
        gathered as one aligned packet.
    frames : mi.Float
        Frame of each view, nine floats each, columns first: x, y, z in world coordinates.
    resolution : mi.UInt32
        Texels a side (opaque: maps of another size need no other kernel).
    """

    texels: mi.UInt32
    frames: mi.Float
    resolution: mi.UInt32

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
        if _WORDS * count * stride**2 > MAX_WORDS:
            raise MachineError(
                f"{count} maps of {resolution}² do not fit into one device array",
                fix="lower the resolution or the views",
            )
        texels = np.empty((count, stride, stride, _WORDS), dtype=np.uint32)
        for image, covered, texel in zip(radiance, coverage > 0, texels, strict=True):
            texel[:] = packed(_filled_outward(np.pad(image, _AROUND), np.pad(covered, _BORDER)))
        return cls(
            texels=resident(mi.UInt32, texels),
            frames=resident(mi.Float, np.swapaxes(frames, 1, 2).astype(np.float32)),
            resolution=dr.opaque(mi.UInt32, resolution),
        )

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
        half = 0.5 * mi.Float(self.resolution)
        # A map's border of one texel makes every coordinate positive and every neighbour exist: nothing is clamped
        column, row = dr.fma(p.x, half, half + 0.5), dr.fma(p.y, -half, half + 0.5)
        left, top = mi.UInt32(column), mi.UInt32(row)
        rightward, downward = column - mi.Float(left), row - mi.Float(top)
        stride = self.resolution + 2 * _BORDER
        corner = dr.fma(top, stride, left) + view * (stride * stride)

        def along(left_end: mi.UInt32) -> mi.Color3f:
            left_m, left_scale = unpacked(dr.gather(mi.Vector2u, self.texels, left_end))
            right_m, right_scale = unpacked(dr.gather(mi.Vector2u, self.texels, left_end + 1))
            return left_m * ((1 - rightward) * left_scale) + right_m * (rightward * right_scale)

        return dr.lerp(along(corner), along(corner + stride), downward)


def _filled_outward(image: NDArray[np.float32], covered: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Give each texel outside the disk the value of the nearest one inside, so that no lookup at the rim darkens."""
    row, column = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return np.asarray(image[row, column])
