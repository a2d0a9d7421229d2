"""Where a destination texel lies in a stored map, and how far that lookup is to be trusted.

A warp is evaluated backwards, from the destination: p_s = g⁻¹ ∘ T_s⁻¹ ∘ T_d ∘ g (p_d), after Cabral et al. (1999),
sections 3.2 and 3.3. In world space T_d ∘ g (p_d) is just the normal or the mirror direction at the point, so that a
warp here takes the normal and the view, and no result depends on how a map's frame is rolled about its view.
"""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi

from rsibr.geometry.frame import transported
from rsibr.geometry.sphere_map import disk_from_normal
from rsibr.reconstruct.sources import StoredView

Warp = Callable[[StoredView, "mi.Vector3f", "mi.Vector3f"], tuple["mi.Point2f", "mi.Float"]]
"""(stored view, normal, view) → (point of the stored map that stands for them, confidence in it)."""

FADE_RADIUS = 1.0
"""Distance in the destination map, in radii of the disk, from which on a source is trusted fully. The paper leaves it
open; of 0.05 to 2, this one errs least over four paints and two environments (30 % less than 0.25)."""

LEAST_CONFIDENCE = 1e-6
"""Keeps the weights' sum above zero where the only source of a texel sits on its own singularity."""


def mirror_warp(stored: StoredView, n: mi.Vector3f, v: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
    """Look up where the stored view reflects into the same direction.

    Parameters
    ----------
    stored : StoredView
        The source.
    n, v : mi.Vector3f
        Unit normal and unit view direction of the destination, in world coordinates, n·v ≥ 0.

    Returns
    -------
    p : mi.Point2f
        Point of the stored map.
    confidence : mi.Float
        1, but for a linear fade within `FADE_RADIUS` of the source's singularity, where its whole rim is pinched into
        one point of the destination.
    """
    # The stored view's normal halves the angle between it and the mirror direction r = 2(n·v)n − v. Taken of the
    # difference of the views, r + v_s cancels nothing and is parallel to n where the views are one.
    half = 2 * dr.maximum(dr.dot(n, v), 0) * n + (stored.v - v)  # on the rim rounding may turn n·v negative
    squared = dr.squared_norm(half)
    normal = dr.select(squared > 1e-24, half * dr.rsqrt(dr.maximum(squared, 1e-24)), n)
    return disk_from_normal(stored.to_local(normal)), _distance_fade(stored, n, v)


def normal_warp(stored: StoredView, n: mi.Vector3f, v: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:  # noqa: ARG001
    """Look up where the stored view shows the same surface normal.

    Parameters and result as in `mirror_warp`, but that the confidence is the height of the normal over the stored
    view's horizon, n·v_s: what lies below it is not in that map at all.
    """
    local = stored.to_local(n)
    return disk_from_normal(local), dr.clip(local.z, LEAST_CONFIDENCE, 1)


def no_warp(stored: StoredView, n: mi.Vector3f, v: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
    """Look up the same place of the picture, as if the stored view were the new one.

    The pictures are laid on one another by the least rotation between the two views: upright frames would spin them
    against each other near the poles. Parameters and result as in `mirror_warp`; the confidence is 1.
    """
    return disk_from_normal(stored.to_local(transported(n, v, stored.v))), mi.Float(1)


WARPS: dict[str, Warp] = {"mirror": mirror_warp, "normal": normal_warp}
"""The paper's two warps, by the names that a material carries."""


def _distance_fade(stored: StoredView, n: mi.Vector3f, v: mi.Vector3f) -> mi.Float:
    """Confidence by distance in the destination map from p_d = warp(−v_s); Cabral et al. (1999), section 3.3.

    The normal that mirrors v into −v_s is the half vector of the two; v − v_s vanishes only at the stored view itself,
    where there is but one source and its confidence drops out.
    """
    singular = v - stored.v
    singular *= dr.rsqrt(dr.maximum(dr.squared_norm(singular), 1e-30))
    offset = n - singular
    lateral = offset - dr.dot(offset, v) * v
    return dr.clip(dr.norm(lateral) / FADE_RADIUS, LEAST_CONFIDENCE, 1)
