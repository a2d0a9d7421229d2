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
    count = across * down
    corner = mi.Point2f(dr.floor((n.x + 1) / spacing), dr.floor((n.y + 1) / spacing)) * spacing - 1

    # ---- One sample: weight 1 inside the disk, 0 outside; the last is `n` itself, for texels that no other hits ----
    def add(k: mi.UInt32, total: mi.Color3f, weight: mi.Float) -> tuple[mi.UInt32, mi.Color3f, mi.Float]:
        x = dr.fma((mi.Float(k % across) + 0.5) / mi.Float(across), spacing, corner.x)
        y = dr.fma((mi.Float(k // across) + 0.5) / mi.Float(down), spacing, corner.y)
        height = 1 - (x * x + y * y)
        is_last = k == count
        share = dr.select(is_last, _FAINT, dr.select(height > 0, 1.0, 0.0))
        sample = dr.select(is_last, n, mi.Vector3f(x, y, dr.sqrt(dr.maximum(height, 0))))
        return k + 1, total + share * seen(sample), weight + share

    _, total, weight = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.Color3f, 1), mi.Float(0) + 0 * n.z),
        cond=lambda k, _total, weight: (k < count) | ((k == count) & (weight == 0)),
        body=add,
        labels=("k", "total", "weight"),
        label=label,
    )
    return total / weight


def sides(n: mi.Vector3f, step: mi.Float, fewest: int, most: int, flattest: float) -> tuple[mi.UInt32, mi.UInt32]:
    """Sample points of texels along their width and height, in proportion to the angle that they span.

    Parameters
    ----------
    n : mi.Vector3f
        Unit normals in the map's frame.
    step : mi.Float
        Width of a texel that faces the viewer, in steps.
    fewest, most : int
        Bounds of either count.
    flattest : float
        Cosine below which the counts do not grow further.

    Notes
    -----
    Upper bound 1 + p pᵀ/cos² θ of the metric from the disk to normals; docs/method.md, section 6.3.
    """
    stretch = dr.rcp(dr.square(dr.maximum(n.z, flattest)))

    def count(place: mi.Float) -> mi.UInt32:
        return mi.UInt32(dr.clip(dr.ceil(step * dr.sqrt(dr.fma(place * place, stretch, 1))), fewest, most))

    return count(n.x), count(n.y)


def radial_mean(
    n: mi.Vector3f, spacing: mi.Float, points: mi.UInt32, seen: Callable[[mi.Vector3f], mi.Color3f]
) -> mi.Color3f:
    """Mean of `seen` along the radius over the part of each texel inside the disk.

    Along the radius the normals of a texel at the rim spread 1/cos θ times as far as across it; docs/method.md, section
    6.5.

    Parameters
    ----------
    n : mi.Vector3f
        Unit normals at the middle of the covered part of each texel, in the map's frame; see `covered_middle`.
    spacing : mi.Float
        Distance of neighbouring texels in radii of the disk.
    points : mi.UInt32
        Number of samples; a single one is taken at `n`.
    seen : callable
        Unit normals in the map's frame → radiance [W sr⁻¹ m⁻²].
    """
    radius, half = dr.sqrt(n.x * n.x + n.y * n.y), 0.5 * spacing
    is_cut = radius + half > 1
    reach = dr.select(is_cut, 1 - radius, half)  # from the middle to either end
    outward = dr.rcp(dr.maximum(radius, 1e-6))

    def add(k: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f]:
        r = radius + reach * ((2 * mi.Float(k) + 1) / mi.Float(points) - 1)
        scale = dr.select(points > 1, r * outward, 1)
        height = dr.sqrt(dr.maximum(1 - r * r, 0))
        return k + 1, total + seen(mi.Vector3f(n.x * scale, n.y * scale, dr.select(points > 1, height, n.z)))

    _, total = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.Color3f, 1)),
        cond=lambda k, _total: k < points,
        body=add,
        labels=("k", "total"),
        label="radial_mean",
    )
    return total / mi.Float(points)
