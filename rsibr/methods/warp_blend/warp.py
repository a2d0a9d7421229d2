"""Where a destination texel lies in a stored map, and how far that lookup is to be trusted.

A warp is evaluated backwards, from the destination: p_s = g⁻¹ ∘ T_s⁻¹ ∘ T_d ∘ g (p_d), after Cabral et al. (1999),
sections 3.2 and 3.3. All of it that depends on the two views alone is one rotation and a few vectors, made once a view;
what is left for each texel costs a handful of operations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import drjit as dr
import mitsuba as mi

from rsibr.geometry.frame import from_columns, transported
from rsibr.geometry.projections.sphere_map import disk_from_normal, disk_from_reflection
from rsibr.methods.warp_blend.source_maps import StoredView

FADE_RADIUS = 1.0
"""Distance in the destination map, in radii of the disk, from which on a source is trusted fully. The paper leaves it
open; of 0.05 to 2, this one errs least over four paints and two environments (30 % less than 0.25)."""

LEAST_CONFIDENCE = 1e-6
"""Keeps the weights' sum above zero where the only source of a texel sits on its own singularity."""


class Warp(Protocol):
    """A correspondence between the map of one view and the map of another."""

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """Look a surface normal up.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals in the destination's frame, z ≥ 0.

        Returns
        -------
        p : mi.Point2f
            Points of the stored map that stand for them.
        confidence : mi.Float
            How far to trust them, in [0, 1].
        """
        ...


WarpBetween = Callable[[StoredView, "mi.Matrix3f"], Warp]
"""(stored view, frame of the destination) → the warp between the two; one pair a lane, or one for all lanes."""


@dataclass
class MirrorWarp:
    """Look up where the stored view reflects into the same direction.

    The confidence fades linearly within `FADE_RADIUS` of the source's singularity, the mirror direction −v_s, where the
    source's whole rim is pinched into one point of the destination.

    Attributes
    ----------
    rotation : mi.Matrix3f
        From the destination's frame to the stored one: T_s⁻¹ T_d.
    shift : mi.Vector3f
        v_s − v in the stored frame.
    singular : mi.Point2f
        Where in the destination −v_s is reflected: p_d = warp(−v_s).
    """

    rotation: mi.Matrix3f
    shift: mi.Vector3f
    singular: mi.Point2f

    @classmethod
    def between(cls, stored: StoredView, frame: mi.Matrix3f) -> MirrorWarp:
        """Make the warp from the destination's `frame`, columns x, y, v, to a stored view."""
        shift = stored.v - _column(frame, 2)
        # The normal that mirrors v into −v_s halves the angle between the two. It is undetermined at the stored view
        # itself, where there is but one source and its confidence drops out.
        singular = -shift * dr.rsqrt(dr.maximum(dr.squared_norm(shift), 1e-30))
        in_map = mi.Point2f(dr.dot(_column(frame, 0), singular), dr.dot(_column(frame, 1), singular))
        return cls(_rotation(stored, frame), stored.to_local(shift), in_map)

    def stored_view(self) -> mi.Vector3f:
        """The stored view's direction in the destination's frame."""
        return mi.Vector3f(self.rotation[2, 0], self.rotation[2, 1], self.rotation[2, 2])

    def disk_of(self, r: mi.Vector3f) -> mi.Point2f:
        """Point of the stored map that mirrors into `r`, a unit direction in the destination's frame."""
        return disk_from_reflection(self.rotation @ r)

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        # The stored view's normal halves the angle between it and the mirror direction r = 2(n·v)n − v. Written with
        # the difference of the views, r + v_s cancels nothing and is parallel to n where the views are one; on the rim
        # of that view, where n·v = 0 (or below, by rounding), n itself is left.
        half = dr.fma(self.rotation @ n, dr.maximum(2 * n.z, 1e-9), self.shift)
        shrink = dr.rsqrt(dr.maximum(dr.squared_norm(half), 1e-30))
        away = mi.Point2f(n.x, n.y) - self.singular
        confidence = dr.minimum(dr.norm(away) * (1 / FADE_RADIUS), 1) + LEAST_CONFIDENCE
        return mi.Point2f(half.x * shrink, half.y * shrink), confidence


@dataclass
class NormalWarp:
    """Look up where the stored view shows the same surface normal.

    The confidence is the height of the normal over the stored view's horizon, n·v_s: what lies below it is not in that
    map at all.

    Attributes
    ----------
    rotation : mi.Matrix3f
        From the destination's frame to the stored one: T_s⁻¹ T_d.
    """

    rotation: mi.Matrix3f

    @classmethod
    def between(cls, stored: StoredView, frame: mi.Matrix3f) -> NormalWarp:
        """Make the warp from the destination's `frame`, columns x, y, v, to a stored view."""
        return cls(_rotation(stored, frame))

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        local = self.rotation @ n
        return disk_from_normal(local), dr.maximum(local.z, LEAST_CONFIDENCE)


@dataclass
class NoWarp:
    """Look up the same place of the picture, as if the stored view were the new one.

    The pictures are laid on one another by the least rotation between the two views: upright frames would spin them
    against each other near the poles. The confidence is 1.

    Attributes
    ----------
    rotation : mi.Matrix3f
        From the destination's frame to the stored one, the view carried along: z stays z.
    """

    rotation: mi.Matrix3f

    @classmethod
    def between(cls, stored: StoredView, frame: mi.Matrix3f) -> NoWarp:
        """Lay the destination, with its `frame` of columns x, y, v, on a stored view."""
        v = _column(frame, 2)
        columns = [stored.to_local(transported(_column(frame, axis), v, stored.v)) for axis in range(3)]
        return cls(from_columns(*columns))

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        return disk_from_normal(self.rotation @ n), mi.Float(1)


WARPS: dict[str, WarpBetween] = {"mirror": MirrorWarp.between, "normal": NormalWarp.between}
"""The paper's two warps, by the names that a material carries."""


def _rotation(stored: StoredView, frame: mi.Matrix3f) -> mi.Matrix3f:
    return from_columns(*(stored.to_local(_column(frame, axis)) for axis in range(3)))


def _column(matrix: mi.Matrix3f, axis: int) -> mi.Vector3f:
    return mi.Vector3f(matrix[0, axis], matrix[1, axis], matrix[2, axis])
