"""Base of methods that shade by lookups in arrays of their own, for single points and for whole sphere maps."""

from __future__ import annotations

from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.sphere_map import covered_middle, normal_from_disk, texel_centre, tiled_texels
from rsibr.methods.frozen import Frozen
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.map_texels import as_rgba, frame_from, laid_out, touches_disk, view_of
from rsibr.methods.protocol import PointwiseMethod
from rsibr.methods.texel_mean import texel_mean

POINTS, MOST_POINTS = 2, 64
"""Points along a side of a map's texel: by default, and at most."""


class Shading(Protocol):
    """Tables on the device, and how they are read: a dataclass of Dr.Jit arrays."""

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        ...


class ShadingMethod(PointwiseMethod):
    """Method whose radiance is that of a `Shading`.

    Parameters
    ----------
    inputs : MethodInputs
        Light and lobes of a bake.
    shading : Shading
        Tables on the device.
    points : int
        Points along a side of a map's texel that are averaged: antialiasing by a box filter; Miller & Hoffman (1984),
        section 8.1. A single one lies at the middle of the texel's part inside the disk.
    """

    def __init__(self, inputs: MethodInputs, shading: Shading, points: int = POINTS) -> None:
        super().__init__(inputs)
        self.shading, self.points = shading, points
        self._frozen = Frozen(_image)

    @backend.in_session
    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        return self.shading.radiance(n, v)

    @backend.in_session
    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.TensorXf:
        """Radiance of a whole sphere map, asynchronously; see `Method.map`. From the second view on it is replayed."""
        columns = mi.Float(frame.T.ravel().tolist())
        image = self._frozen(self.shading, columns, resolution, self.points)
        return mi.TensorXf(image, (resolution, resolution, 4))

    def image(self, columns: mi.Float, resolution: int) -> mi.Float:
        """Trace the texels of a map, row-major RGBA, flat; `columns` holds the frame's columns as nine floats."""
        return _image(self.shading, columns, resolution, self.points)


def _image(shading: Shading, columns: mi.Float, resolution: int, points: int) -> mi.Float:
    to_world, texel = frame_from(columns), tiled_texels(resolution)
    p, v = texel_centre(texel, resolution), view_of(to_world)
    n = normal_from_disk(covered_middle(p, resolution))

    def seen(local: mi.Vector3f) -> mi.Color3f:
        return shading.radiance(to_world @ local, v)

    side = mi.UInt32(points)
    spacing = mi.Float(2 / resolution)
    radiance = seen(n) if points == 1 else texel_mean(n, spacing, (side, side), seen, "shading")
    return laid_out(dr.select(touches_disk(p, resolution), as_rgba(radiance), 0), texel, resolution)
