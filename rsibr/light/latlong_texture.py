"""Latitude–longitude image of the environment on the device, interpolated as by Mitsuba's `envmap`."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.to_device import to_device
from rsibr.light.shared_exponent import bilinear, packed


@dataclass(eq=False)
class LatLongTexture:
    """Texels and orientation of a latitude–longitude image.

    Attributes
    ----------
    texels : mi.Float
        Rows from the top, flat; each row is followed by its first texel, and the last row is repeated. Two words a
        texel as bits of floats, see `rsibr.light.shared_exponent`.
    height, width : mi.UInt32
        Number of rows and columns, without the repeated ones (opaque).
    to_image : mi.Matrix3f
        Rotation from world coordinates to the image's axes.
    """

    texels: mi.Float
    height: mi.UInt32
    width: mi.UInt32
    to_image: mi.Matrix3f

    @classmethod
    def of(cls, image: NDArray[np.float32], frame: NDArray[np.float64]) -> LatLongTexture:
        """Copy an image to the device; `image` and `frame` as in `rsibr.light.radiance.Light`."""
        bordered = np.pad(np.pad(image, ((0, 0), (0, 1), (0, 0)), mode="wrap"), ((0, 1), (0, 0), (0, 0)), mode="edge")
        to_image = mi.Matrix3f(frame.T.astype(np.float32))
        dr.make_opaque(to_image)
        height, width = (dr.opaque(mi.UInt32, size) for size in image.shape[:2])
        return cls(to_device(mi.Float, packed(bordered).view(np.float32)), height, width, to_image)

    def fetch(self, d: mi.Vector3f) -> mi.Color3f:
        """Radiance [W sr⁻¹ m⁻²] in unit directions in world coordinates, by bilinear lookup."""
        local = self.to_image @ d
        turn = dr.atan2(local.x, -local.z) * dr.inv_two_pi
        column = (turn - dr.floor(turn)) * mi.Float(self.width) - 0.5
        column = dr.select(column < 0, column + mi.Float(self.width), column)
        row = dr.safe_acos(local.y) * dr.inv_pi * mi.Float(self.height - 1)
        left, top = dr.minimum(mi.UInt32(column), self.width - 1), dr.minimum(mi.UInt32(row), self.height - 1)
        cell = BilinearCell(left, top, column - mi.Float(left), row - mi.Float(top))
        corner = cell.corner(self.width + 1)
        return bilinear(self.texels, cell, corner, corner + 1, self.width + 1)
