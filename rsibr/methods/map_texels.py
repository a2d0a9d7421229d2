"""Texels of a sphere map in a kernel: its frame, its rim, and its layout in memory."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.geometry.frame import from_columns


def frame_from(columns: mi.Float) -> mi.Matrix3f:
    """Frame from nine floats: its columns x, y and z, concatenated."""
    return from_columns(*(dr.gather(mi.Vector3f, columns, mi.UInt32(axis)) for axis in range(3)))


def view_of(frame: mi.Matrix3f) -> mi.Vector3f:
    """View direction of a frame: its third column."""
    return mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2])


def laid_out(radiance: mi.Vector4f, texel: mi.UInt32, resolution: int) -> mi.Float:
    """Scatter texels that were computed in any order into an RGBA image, row-major, flat.

    Four channels, so that a texel is written as one packet.
    """
    image = dr.empty(mi.Float, 4 * resolution**2)
    dr.scatter(image, radiance, texel)
    return image


def as_rgba(radiance: mi.Color3f) -> mi.Vector4f:
    """Radiance with alpha 1, for a texel that may overlap the disk."""
    return mi.Vector4f(radiance.x, radiance.y, radiance.z, 1)


def touches_disk(p: mi.Point2f, resolution: int) -> mi.Bool:
    """Whether a texel with centre p may overlap the disk: its corners lie √2/N from its centre."""
    return dr.squared_norm(p) < (1 + np.sqrt(2) / resolution) ** 2
