"""MIP pyramid of a cube on the device: bilinear lookups in a level, trilinear ones between two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.projections.projection import projection
from rsibr.geometry.to_device import to_device
from rsibr.methods.kautz2003.faces import Faces, bordered


@dataclass(eq=False)
class CubePyramid:
    """Levels of a cube, the finest first.

    Attributes
    ----------
    texels : mi.Float
        Texels of all levels, six faces each with a border of one texel, flat; four floats a texel,
        which are loaded at once.
    starts, sizes : mi.UInt32
        Offset of each level in texels, and its texels a side.
    last : mi.Float
        Index of the last level (opaque).
    """

    texels: mi.Float
    starts: mi.UInt32
    sizes: mi.UInt32
    last: mi.Float

    @classmethod
    def of(cls, levels: Sequence[Faces], *, seams: bool) -> CubePyramid:
        """Copy levels to the device.

        Parameters
        ----------
        levels : sequence of ndarray, shape (6, N_k, N_k, 3)
            Radiance [W sr⁻¹ m⁻²].
        seams : bool
            Whether lookups are filtered across the faces' edges; see `rsibr.methods.kautz2003.faces.bordered`.
        """
        sizes = np.array([level.shape[1] for level in levels], dtype=np.uint32)
        starts = np.concatenate([[0], np.cumsum(6 * (sizes + 2) ** 2)]).astype(np.uint32)
        texels = np.zeros((int(starts[-1]), 4), dtype=np.float32)
        for level, size, start, end in zip(levels, sizes, starts[:-1], starts[1:], strict=True):
            bordered(level, seams=seams, out=texels[start:end].reshape(6, size + 2, size + 2, 4)[..., :3])
        return cls(
            texels=to_device(mi.Float, texels),
            starts=to_device(mi.UInt32, starts[:-1]),
            sizes=to_device(mi.UInt32, sizes),
            last=dr.opaque(mi.Float, len(levels) - 1),
        )

    def lookup(self, d: mi.Vector3f, level: mi.Float) -> mi.Color3f:
        """Trilinear lookup.

        Parameters
        ----------
        d : mi.Vector3f
            Directions in world coordinates.
        level : mi.Float
            Level of detail, 0 for the finest; clipped to the levels that there are.

        Returns
        -------
        mi.Color3f
            Radiance [W sr⁻¹ m⁻²].
        """
        place = dr.clip(level, 0, self.last)
        lower = mi.UInt32(place)
        upper = dr.minimum(lower + 1, mi.UInt32(self.last))
        return dr.lerp(self.fetch(d, lower), self.fetch(d, upper), place - mi.Float(lower))

    def fetch(self, d: mi.Vector3f, level: mi.UInt32) -> mi.Color3f:
        """Bilinear lookup of the radiance [W sr⁻¹ m⁻²] in one level, in the directions `d`."""
        start, size = dr.gather(mi.UInt32, self.starts, level), dr.gather(mi.UInt32, self.sizes, level)
        sheet, p = projection("cube").place(d)
        cell = BilinearCell.at(dr.fma(p.x, mi.Float(size), 0.5), dr.fma(p.y, mi.Float(size), 0.5))
        stride = size + 2
        corner = cell.corner(stride) + start + sheet * stride * stride
        upper = dr.lerp(self._texel(corner), self._texel(corner + 1), cell.rightward)
        below = corner + stride
        lower = dr.lerp(self._texel(below), self._texel(below + 1), cell.rightward)
        return dr.lerp(upper, lower, cell.downward)

    def _texel(self, index: mi.UInt32) -> mi.Color3f:
        texel = dr.gather(mi.Vector4f, self.texels, index)
        return mi.Color3f(texel.x, texel.y, texel.z)
