"""Mean over the part of a sphere map's texel inside the disk, on a regular grid of points."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi

_FAINT = 1e-6  # weight of the fallback sample


def texel_mean(
    n: mi.Vector3f,
    spacing: mi.Float,
    points: tuple[mi.UInt32, mi.UInt32],
    seen: Callable[[mi.Vector3f], mi.Color3f],
    label: str,
) -> mi.Color3f:
    """Mean of `seen` over each texel.

    Parameters
    ----------
    n : mi.Vector3f
        Unit normal of any point of each texel, in the map's frame.
    spacing : mi.Float
        Distance of neighbouring texels in radii of the disk.
    points : tuple of two mi.UInt32
        Sample points along the width and the height of each texel.
    seen : callable
        Unit normals in the map's frame → radiance [W sr⁻¹ m⁻²].
    label : str
        Name of the loop in Dr.Jit's log.

    Returns
    -------
    mi.Color3f
        [W sr⁻¹ m⁻²]; `seen(n)` where no sample lies inside the disk.
    """
    across, down = points
    corner = mi.Point2f(dr.floor((n.x + 1) / spacing), dr.floor((n.y + 1) / spacing)) * spacing - 1

    # ---- One sample: weight 1 inside the disk, 0 outside ----
    def add(k: mi.UInt32, total: mi.Color3f, weight: mi.Float) -> tuple[mi.UInt32, mi.Color3f, mi.Float]:
        x = dr.fma((mi.Float(k % across) + 0.5) / mi.Float(across), spacing, corner.x)
        y = dr.fma((mi.Float(k // across) + 0.5) / mi.Float(down), spacing, corner.y)
        height = 1 - (x * x + y * y)
        share = dr.select(height > 0, 1.0, 0.0)
        light = seen(mi.Vector3f(x, y, dr.sqrt(dr.maximum(height, 0))))
        return k + 1, total + share * light, weight + share

    _, total, weight = dr.while_loop(
        state=(mi.UInt32(0), _FAINT * seen(n), mi.Float(_FAINT) + 0 * n.z),
        cond=lambda k, _total, _weight: k < across * down,
        body=add,
        labels=("k", "total", "weight"),
        label=label,
    )
    return total / weight
