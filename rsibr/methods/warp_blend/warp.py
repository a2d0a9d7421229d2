"""Warps from a destination texel to a point of a stored map, with a confidence.

A warp is evaluated backwards, from the destination: p_s = g⁻¹ ∘ T_s⁻¹ ∘ T_d ∘ g (p_d), after Cabral et al. (1999),
sections 3.2 and 3.3. For a whole map, the part that depends only on the two views, one rotation and a few vectors, is
computed once a view (`between`). Single points have a view of their own each: they are warped in world coordinates,
without a frame of the destination (`at`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import drjit as dr
import mitsuba as mi

from rsibr.geometry.frame import from_columns, transported
from rsibr.geometry.projections.sphere_map import disk_from_normal, disk_from_reflection
from rsibr.methods.warp_blend.source_maps import StoredView

FADE_RADIUS = 1.0
"""Distance from the singularity in the destination map [radii of the disk] at which the confidence reaches 1. The paper
gives no value; of 0.05 to 2, this one has the smallest error over four paints and two environments (30 % less than
0.25)."""

LEAST_CONFIDENCE = 1e-6
"""Keeps the sum of weights positive where the only source of a texel is evaluated at its singularity."""


class Warp(Protocol):
    """Correspondence between the map of a destination view and a stored map."""

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """Map a surface normal of the destination to a point of the stored map.

        Parameters
        ----------
        n : mi.Vector3f
            Unit normals that face the destination's view, in its frame, or in world coordinates; see `WarpKind`.

        Returns
        -------
        p : mi.Point2f
            Corresponding points of the stored map, in the unit disk.
        confidence : mi.Float
            Factor on the weight of the lookup, in [0, 1].
        """
        ...


class WarpKind(Protocol):
    """Makes the warps of one kind."""

    def between(self, stored: StoredView, frame: mi.Matrix3f) -> Warp:
        """Make the warp of normals in the destination's `frame`, columns x, y, v, to a stored view."""
        ...

    def at(self, stored: StoredView, v: mi.Vector3f) -> Warp:
        """Make the warp of normals in world coordinates, seen from `v`, to a stored view."""
        ...


@dataclass
class MirrorWarp:
    """Warp to the point of the stored map with the same mirror direction.

    The confidence falls linearly to 0 within `FADE_RADIUS` of the source's singularity, the mirror direction −v_s,
    where the whole rim of the source is mapped to one point of the destination.

    Attributes
    ----------
    rotation : mi.Matrix3f
        From the destination's frame to the stored one: T_s⁻¹ T_d.
    shift : mi.Vector3f
        v_s − v in the stored frame.
    singular : mi.Point2f
        Point of the destination with the mirror direction −v_s.
    """

    rotation: mi.Matrix3f
    shift: mi.Vector3f
    singular: mi.Point2f

    @classmethod
    def between(cls, stored: StoredView, frame: mi.Matrix3f) -> MirrorWarp:
        """Make the warp from the destination's `frame`, columns x, y, v, to a stored view."""
        shift = stored.v - _column(frame, 2)
        singular = _singular(shift)
        in_map = mi.Point2f(dr.dot(_column(frame, 0), singular), dr.dot(_column(frame, 1), singular))
        return cls(_rotation(stored, frame), stored.to_local(shift), in_map)

    @staticmethod
    def at(stored: StoredView, v: mi.Vector3f) -> PointMirrorWarp:
        """Make the warp of normals in world coordinates, seen from `v`, to a stored view."""
        return PointMirrorWarp(stored, v)

    def stored_view(self) -> mi.Vector3f:
        """Direction of the stored view in the destination's frame."""
        return mi.Vector3f(self.rotation[2, 0], self.rotation[2, 1], self.rotation[2, 2])

    def disk_of(self, r: mi.Vector3f) -> mi.Point2f:
        """Point of the stored map with the mirror direction `r`, a unit vector in the destination's frame."""
        return disk_from_reflection(self.rotation @ r)

    def normal(self, n: mi.Vector3f) -> mi.Vector3f:
        """Unit normal of the stored map with the mirror direction of `n`, in the frame of the stored map.

        Its z is the cosine under which the stored view sees it. √(1 − x² − y²) would be rounding noise at the rim.
        """
        return _bisecting(self.rotation @ n, n.z, self.shift)

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        stored, away = self.normal(n), mi.Point2f(n.x, n.y) - self.singular
        return mi.Point2f(stored.x, stored.y), _faded(dr.norm(away))


@dataclass
class PointMirrorWarp:
    """`MirrorWarp` for single points, each with a view of its own.

    Attributes
    ----------
    stored : StoredView
        Stored view.
    v : mi.Vector3f
        View of each point.
    """

    stored: StoredView
    v: mi.Vector3f

    def normal(self, n: mi.Vector3f) -> mi.Vector3f:
        """As `MirrorWarp.normal`, for normals in world coordinates."""
        return self.stored.to_local(_bisecting(n, dr.dot(n, self.v), self.stored.v - self.v))

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        stored, away = self.normal(n), dr.cross(n - _singular(self.stored.v - self.v), self.v)
        return mi.Point2f(stored.x, stored.y), _faded(dr.norm(away))


@dataclass
class NormalWarp:
    """Warp to the point of the stored map with the same surface normal.

    The confidence is the cosine n·v_s; normals below the stored view's horizon are not in its map.

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

    @classmethod
    def at(cls, stored: StoredView, v: mi.Vector3f) -> NormalWarp:  # noqa: ARG003
        """Make the warp of normals in world coordinates to a stored view, from whatever view they are seen."""
        return cls(from_columns(stored.x, stored.y, stored.v).T)

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        local = self.rotation @ n
        return disk_from_normal(local), dr.maximum(local.z, LEAST_CONFIDENCE)


@dataclass
class NoWarp:
    """Identity warp: same point of the map, as if the stored view were the new one.

    The maps are aligned by the smallest rotation between the two views, because upright frames rotate against each
    other near the poles. The confidence is 1.

    Attributes
    ----------
    rotation : mi.Matrix3f
        From the destination's frame, transported to the stored view, to the stored frame: z is preserved.
    """

    rotation: mi.Matrix3f

    @classmethod
    def between(cls, stored: StoredView, frame: mi.Matrix3f) -> NoWarp:
        """Make the warp from the destination's `frame`, columns x, y, v, to a stored view."""
        # Transports the destination's axes along the great circle between the views
        v = _column(frame, 2)
        columns = [stored.to_local(transported(_column(frame, axis), v, stored.v)) for axis in range(3)]
        return cls(from_columns(*columns))

    @staticmethod
    def at(stored: StoredView, v: mi.Vector3f) -> PointNoWarp:
        """Make the warp of normals in world coordinates, seen from `v`, to a stored view."""
        return PointNoWarp(stored, v)

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        return disk_from_normal(self.rotation @ n), mi.Float(1)


@dataclass
class PointNoWarp:
    """`NoWarp` for single points, each with a view of its own.

    Attributes
    ----------
    stored : StoredView
        Stored view.
    v : mi.Vector3f
        View of each point.
    """

    stored: StoredView
    v: mi.Vector3f

    def __call__(self, n: mi.Vector3f) -> tuple[mi.Point2f, mi.Float]:
        """See `Warp`."""
        return disk_from_normal(self.stored.to_local(transported(n, self.v, self.stored.v))), mi.Float(1)


WARPS: dict[str, WarpKind] = {"mirror": MirrorWarp, "normal": NormalWarp}
"""The paper's two warps, by the name in a material's record."""


def _bisecting(n: mi.Vector3f, cosine: mi.Float, shift: mi.Vector3f) -> mi.Vector3f:
    """Normal that mirrors the stored view where `n` mirrors the new one; `shift` is v_s − v, `cosine` n·v."""
    # It bisects v_s and the mirror direction r = 2(n·v)n − v. Written as 2(n·v)n + (v_s − v), r + v_s has no
    # cancellation and is parallel to n where the views coincide. On the rim of that view, where n·v is 0 or slightly
    # negative by rounding, n itself remains.
    half = dr.fma(n, dr.maximum(2 * cosine, 1e-9), shift)
    return half * dr.rsqrt(dr.maximum(dr.squared_norm(half), 1e-30))


def _singular(shift: mi.Vector3f) -> mi.Vector3f:
    """Normal of the new view whose mirror direction is −v_s; `shift` is v_s − v."""
    # It bisects v and −v_s. It is undefined at the stored view itself, where there is only one source and its
    # confidence cancels.
    return -shift * dr.rsqrt(dr.maximum(dr.squared_norm(shift), 1e-30))


def _faded(away: mi.Float) -> mi.Float:
    """Confidence at a distance from the singularity [radii of the disk]."""
    return dr.minimum(away * (1 / FADE_RADIUS), 1) + LEAST_CONFIDENCE


def _rotation(stored: StoredView, frame: mi.Matrix3f) -> mi.Matrix3f:
    return from_columns(*(stored.to_local(_column(frame, axis)) for axis in range(3)))


def _column(matrix: mi.Matrix3f, axis: int) -> mi.Vector3f:
    return mi.Vector3f(matrix[0, axis], matrix[1, axis], matrix[2, axis])
