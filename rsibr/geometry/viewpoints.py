"""Stored view directions, their triangulation of the sphere, and point location in it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError
from rsibr.geometry.partial_views import (
    GAP_DEG,
    PartialSphere,
    check_triangles,
    circumradii,
    covers,
    nearest_view,
    neighbourhoods,
)
from rsibr.geometry.to_device import to_device
from rsibr.geometry.triangle_grid import TriangleGrid

VIEW_COUNTS = (12, 42, 162, 642, 2562, 10242)
"""Number of vertices of each icosphere. They are nested: the vertices of one are the first ones of the next."""

MAX_SUBDIVISION = 5
"""10 242 views; with more, the triangles' sides would approach the resolution of float32 weights."""

_GOLDEN = (1 + 5**0.5) / 2
_ICOSAHEDRON = (
    *((-1, _GOLDEN, 0), (1, _GOLDEN, 0), (-1, -_GOLDEN, 0), (1, -_GOLDEN, 0)),
    *((0, -1, _GOLDEN), (0, 1, _GOLDEN), (0, -1, -_GOLDEN), (0, 1, -_GOLDEN)),
    *((_GOLDEN, 0, -1), (_GOLDEN, 0, 1), (-_GOLDEN, 0, -1), (-_GOLDEN, 0, 1)),
)
_FACES = (
    *((0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6)),
    *((7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10)),
    *((8, 6, 7), (9, 8, 1)),
)
"""Icosahedron in the order of trimesh, whose finer icospheres begin with these vertices."""

_NESTED = 1e-12
"""Tolerance of a component within which two unit directions are equal."""


@dataclass(frozen=True, eq=False)
class Viewpoints:
    """Stored view directions and the triangles that cover the sphere, on the host.

    Attributes
    ----------
    directions : ndarray, shape (N, 3)
        Unit directions from the surface to the viewer, in world coordinates, float64.
    triangles : ndarray, shape (M, 3)
        Indices into `directions`, counter-clockwise seen from outside.
    is_partial : bool
        Whether the triangles leave part of the sphere open: a capture from half a sphere, or from a ring.
    """

    directions: NDArray[np.float64]
    triangles: NDArray[np.int64]
    is_partial: bool = False

    def __len__(self) -> int:
        return len(self.directions)

    @property
    def covered(self) -> float:
        """Share of the sphere inside the triangles."""
        return float(min(_solid_angles(self.directions[self.triangles]).sum() / (4 * np.pi), 1.0))

    @property
    def largest_circumradius(self) -> float:
        """Largest distance of a direction inside a triangle from all views [rad]; 0 without triangles."""
        return float(circumradii(self.directions[self.triangles]).max(initial=0.0))

    def covers(self, views: ArrayLike) -> NDArray[np.bool_]:
        """Whether unit directions, shape (n, 3), lie between stored views; see `partial_views.covers`."""
        asked = np.atleast_2d(np.asarray(views, dtype=np.float64))
        return (
            covers(self.directions, self.triangles, asked) if self.is_partial else np.ones(len(asked), dtype=np.bool_)
        )

    @cached_property
    def on_device(self) -> Sphere:
        """Copy on the device, for lookups in kernels."""
        if self.is_partial:
            return PartialSphere.of(self.directions, self.triangles)
        return ViewSphere(
            directions=to_device(mi.Float, self.directions.astype(np.float32)),
            triangles=to_device(mi.UInt32, self.triangles.astype(np.uint32)),
            grid=TriangleGrid.build(self.directions[self.triangles]),
            count=dr.opaque(mi.UInt32, len(self)),
        )

    def direction(self, index: mi.UInt32) -> mi.Vector3f:
        """See `ViewSphere.direction`."""
        return self.on_device.direction(index)

    def surrounding(self, v: mi.Vector3f) -> mi.Vector3u:
        """See `ViewSphere.surrounding`."""
        return self.on_device.surrounding(v)

    def nearest(self, v: mi.Vector3f) -> mi.UInt32:
        """See `ViewSphere.nearest`."""
        return self.on_device.nearest(v)


@dataclass(frozen=True, eq=False)
class ViewSphere:
    """Stored view directions and their triangles on the device.

    Attributes
    ----------
    directions : mi.Float
        Unit directions, three floats each, flat.
    triangles : mi.UInt32
        Indices of the directions, three each, flat.
    grid : TriangleGrid
        Triangles by the cells of a grid, for point location.
    count : mi.UInt32
        Number of directions (opaque, so that all counts share one kernel).
    """

    directions: mi.Float
    triangles: mi.UInt32
    grid: TriangleGrid
    count: mi.UInt32

    def direction(self, index: mi.UInt32) -> mi.Vector3f:
        """Stored direction of the view `index`, one a lane."""
        return dr.gather(mi.Vector3f, self.directions, index)

    def surrounding(self, v: mi.Vector3f) -> mi.Vector3u:
        """Indices of the three views whose triangle contains `v`.

        Parameters
        ----------
        v : mi.Vector3f
            Unit directions, one a lane.

        Returns
        -------
        mi.Vector3u
            View indices. On an edge or at a vertex, those of any of the triangles that share it.
        """
        return dr.gather(mi.Vector3u, self.triangles, self.grid.locate(v))

    def nearest(self, v: mi.Vector3f) -> mi.UInt32:
        """Index of the stored view nearest to `v`; the first of several at the same distance.

        It need not be a corner of the triangle around `v`: for 8 to 13 % of directions at subdivisions 1 to 3 the three
        nearest views are not the corners.

        Parameters
        ----------
        v : mi.Vector3f
            Unit directions, one a lane.
        """
        return nearest_view(self.directions, self.count, v)


Sphere = ViewSphere | PartialSphere
"""Stored views on the device, whether or not their triangles cover the sphere."""


def witness(viewpoints: Viewpoints) -> Viewpoints:
    """First view alone, without triangles: the map that checks a material whose appearance needs no stored views."""
    return Viewpoints(viewpoints.directions[:1], np.zeros((0, 3), dtype=np.int64))


def icosphere(subdivision: int) -> Viewpoints:
    """Icosphere: 12, 42, 162, 642, 2562 or 10 242 views at the vertices of a subdivided icosahedron.

    Parameters
    ----------
    subdivision : int
        0 (the icosahedron of Cabral et al. (1999), section 3.1) to 5.

    Raises
    ------
    InputError
        If `subdivision` is out of range.

    Examples
    --------
    >>> len(icosphere(1))
    42
    """
    if not 0 <= subdivision <= MAX_SUBDIVISION:
        raise InputError(f"{subdivision} is no subdivision", where="views.subdivision", fix="give 0 to 5")
    if subdivision == 0:
        return from_directions(_ICOSAHEDRON, _FACES)
    import trimesh  # noqa: PLC0415  # a third of a second that only this function needs

    mesh = trimesh.creation.icosphere(subdivisions=subdivision)
    return from_directions(mesh.vertices, mesh.faces)


def first_views(viewpoints: Viewpoints, count: int) -> Viewpoints:
    """First views of an icosphere, with the triangulation of the coarser icosphere that they form.

    Parameters
    ----------
    viewpoints : Viewpoints
        An icosphere, or any views if `count` is their number.
    count : int
        Number of views: all, or one of `VIEW_COUNTS`.

    Raises
    ------
    ValueError
        If no icosphere has `count` vertices, or its vertices are not the first of these views.
    """
    if count == len(viewpoints):
        return viewpoints
    first = icosphere(VIEW_COUNTS.index(count))
    if not np.allclose(first.directions, viewpoints.directions[:count], rtol=0.0, atol=_NESTED):
        raise ValueError(f"the first {count} views are not those of an icosphere")
    return first


def from_directions(directions: ArrayLike, triangles: ArrayLike | None = None) -> Viewpoints:
    """Views in given directions.

    Parameters
    ----------
    directions : array_like, shape (N, 3)
        Directions of any positive length, N ≥ 4, not all in one hemisphere.
    triangles : array_like, shape (M, 3), optional
        Indices of the triangles that cover the sphere, in either orientation. By default the convex hull.

    Raises
    ------
    InputError
        If a direction is zero or not finite, two of them coincide, an index is out of range, or the triangles do not
        cover the sphere exactly once.
    """
    vertices = _unit_directions(directions)
    faces = _hull(vertices) if triangles is None else _checked_triangles(triangles, len(vertices))
    corners = vertices[faces]
    inward = np.linalg.det(corners) < 0
    faces[inward] = faces[inward][:, ::-1]
    covered = _solid_angles(vertices[faces]).sum()
    if not np.isclose(covered, 4 * np.pi, rtol=1e-6):
        raise InputError(
            f"the triangles cover {covered / (4 * np.pi):.4f} of the sphere, not 1",
            where="views",
            fix="give triangles that cover the sphere exactly once, or leave them out to take the convex hull",
        )
    return Viewpoints(vertices, faces)


def partial_views(directions: ArrayLike, triangles: ArrayLike | None = None, *, gap_deg: float = GAP_DEG) -> Viewpoints:
    """Views in given directions, which need not surround the sphere.

    Parameters
    ----------
    directions : array_like, shape (N, 3)
        Directions of any positive length, N ≥ 1.
    triangles : array_like, shape (M, 3), optional
        Indices of the triangles between neighbours, counter-clockwise seen from outside. By default those of the
        convex hull whose circumradius is at most `gap_deg`.
    gap_deg : float
        Largest circumradius of a triangle that is taken from the hull [degrees], up to 90.

    Returns
    -------
    Viewpoints
        As of `from_directions` where the triangles cover the sphere; otherwise partial: a direction outside of all
        triangles is looked up at the nearest point of an edge between neighbours.

    Raises
    ------
    InputError
        If a direction is zero or not finite, two of them coincide, or the triangles do not fit.

    Examples
    --------
    >>> ring = partial_views([[1, 0, 0], [0, 0, 1], [-1, 0, 0], [0, 0, -1]])
    >>> len(ring.triangles), ring.covers([[0, 1, 0], [0.6, 0, 0.8]]).tolist()
    (0, [False, True])
    """
    if not 0 < gap_deg <= 90:
        raise InputError(f"a gap of {gap_deg:g}°", where="gap", fix="give up to 90 degrees")
    vertices = _unit_directions(directions, least=1)
    faces = neighbourhoods(vertices, gap_deg) if triangles is None else check_triangles(vertices, triangles)
    whole = bool(np.isclose(_solid_angles(vertices[faces]).sum(), 4 * np.pi, rtol=1e-6))
    return Viewpoints(vertices, faces, is_partial=not whole)


def _unit_directions(directions: ArrayLike, least: int = 4) -> NDArray[np.float64]:
    try:
        vertices = np.asarray(directions, dtype=np.float64)
    except (TypeError, ValueError):
        vertices = np.empty(0)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) < least:
        number = "four" if least == 4 else str(least)
        raise InputError(f"directions must be a list of at least {number} [x, y, z]", where="views")
    lengths = np.linalg.norm(vertices, axis=1)
    wrong = np.flatnonzero(~np.isfinite(lengths) | (lengths == 0))
    if len(wrong):
        raise InputError(f"direction {wrong[0]} is zero or not finite", where="views", fix="give it a direction")
    vertices = vertices / lengths[:, None]
    if len(np.unique(vertices.round(6), axis=0)) < len(vertices):
        raise InputError("two directions coincide", where="views", fix="give each direction once")
    return np.asarray(vertices)


def _checked_triangles(triangles: ArrayLike, count: int) -> NDArray[np.int64]:
    try:
        faces = np.array(triangles, dtype=np.int64)
    except (TypeError, ValueError):
        faces = np.empty(0, dtype=np.int64)
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError("triangles must be a list of [i, j, k]", where="views")
    if faces.min() < 0 or faces.max() >= count:
        raise InputError(f"a triangle names a direction that is not there (there are {count})", where="views")
    return faces


def _hull(vertices: NDArray[np.float64]) -> NDArray[np.int64]:
    from scipy.spatial import ConvexHull, QhullError  # noqa: PLC0415  # only this function needs it

    try:
        return np.asarray(ConvexHull(vertices).simplices, dtype=np.int64)
    except QhullError:
        raise InputError("the directions lie in one plane", where="views", fix="spread them over the sphere") from None


def _solid_angles(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solid angles [sr] of the triangles (M, 3, 3), on the host in float64; see `spherical.solid_angle`."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    numerator = np.einsum("ij,ij->i", a, np.cross(b - a, c - a))
    denominator = 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1)
    return np.asarray(2 * np.arctan2(numerator, denominator))
