"""Repair of triangle meshes before they are shaded: faces without area, windings, missing and unusable normals.

All of it is vectorised, and works on the coordinates in float32, as the device will see them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rsibr.errors import InputError

CREASE_DEG = 40.0
"""Angle between two faces above which their common edge is sharp, in a file without normals [degrees].

A cube, a hexagonal prism and a bevel of 45° keep their edges; a cylinder of ten sides or more, an icosphere from
subdivision 1 on and the panels of a coarse car are smooth. Modelling programs use 30° to 60°.
"""

_FARTHEST = 1e15
"""Largest coordinate; squares of larger ones overflow in float32."""

_LEAST_NORMAL = 1e-3
"""Length below which a vertex normal of a file counts as zero; exporters write unit vectors."""

_FLATTEST = 1e-12
"""Twice the area over the squared longest edge at which a triangle is a line."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles of one shape.

    Attributes
    ----------
    vertices : ndarray, shape (V, 3)
        Positions.
    faces : ndarray, shape (F, 3)
        Vertices of each triangle, counter-clockwise seen from outside.
    normals : ndarray, shape (V, 3), or None
        Vertex normals; None if there are none.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None


def repaired(mesh: TriangleMesh, name: str, where: str) -> tuple[TriangleMesh, tuple[str, ...]]:
    """Drop what cannot be shaded, make windings consistent, and see that every vertex has a unit normal.

    Triangles with vertices that are no numbers, or without area, are dropped. Neighbours with opposite windings are
    made to agree, and closed surfaces to face outward. Vertex normals of the file are kept; those that are zero, NaN or
    against all faces of their vertex are mended. If there are none, they are computed: angle-weighted means (Thürmer
    and Wüthrich 1998) over the faces that meet at a vertex across edges of at most `CREASE_DEG`, with vertices at the
    same place welded first. Sharper edges stay sharp.

    Parameters
    ----------
    mesh : TriangleMesh
        As in the file.
    name : str
        Shape id, for the notes.
    where : str
        File that an error names.

    Returns
    -------
    mesh : TriangleMesh
        With unit normals, coordinates rounded to float32.
    notes : tuple of str
        What was changed, in a sentence each.

    Raises
    ------
    InputError
        If faces refer to vertices that do not exist, or no triangle with an area is left.

    Examples
    --------
    >>> corner = TriangleMesh(np.eye(3), np.array([[0, 1, 2], [0, 0, 1]]))
    >>> mesh, notes = repaired(corner, "corner", "corner.obj")
    >>> len(mesh.faces), notes
    (1, ("'corner': 1 of 2 triangles has no area, and was dropped",))
    """
    notes: list[str] = []
    mesh = _with_area(_finite(mesh, name, where, notes), name, where, notes)
    welded = _welded(mesh)
    edges = _Edges.of(welded, mesh.faces.shape[0])
    mesh, turned = _wound(mesh, edges)
    if turned:
        is_whole = turned == len(mesh.faces)
        what = f"{_share(turned, len(mesh.faces), 'triangle')} wound against the others, and turned"
        notes.append(f"'{name}': {'it was inside out, and was turned' if is_whole else what}")
        edges = _Edges.of(_welded(mesh), mesh.faces.shape[0])
    if mesh.normals is None or not _usable(mesh.normals).any():
        return _with_creases(mesh, edges), tuple(notes)
    return _with_mended_normals(mesh, mesh.normals, name, notes), tuple(notes)


def _share(count: int, total: int, what: str) -> str:
    return f"{count} of {total} {what}s {'is' if count == 1 else 'are'}"


def _finite(mesh: TriangleMesh, name: str, where: str, notes: list[str]) -> TriangleMesh:
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        what = f"'{name}' has faces of vertices that do not exist ({len(vertices)} are there)"
        raise InputError(what, where=where, fix="export it anew: the file is damaged")
    with np.errstate(invalid="ignore"):
        is_finite = np.all(np.abs(vertices) < _FARTHEST, axis=1)
    kept = is_finite[faces].all(axis=1)
    if lost := int((~kept).sum()):
        what = "has a vertex that is" if lost == 1 else "have vertices that are"
        notes.append(
            f"'{name}': {lost} of {len(faces)} triangles {what} no number or too large, and "
            f"{'was' if lost == 1 else 'were'} dropped"
        )
    vertices = np.where(is_finite[:, None], vertices, 0).astype(np.float32).astype(np.float64) + 0.0  # no −0
    return replace(mesh, vertices=vertices, faces=faces[kept])


def _with_area(mesh: TriangleMesh, name: str, where: str, notes: list[str]) -> TriangleMesh:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0, initial=0)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    kept = doubled > np.maximum(_FLATTEST * longest, 1e-36)
    if not kept.any():
        raise InputError(f"'{name}' has no triangle with an area", where=where, fix="give a mesh with surfaces")
    if lost := int((~kept).sum()):
        has, was = ("has", "was") if lost == 1 else ("have", "were")
        notes.append(f"'{name}': {lost} of {len(kept)} triangles {has} no area, and {was} dropped")
    return replace(mesh, faces=mesh.faces[kept])


def _welded(mesh: TriangleMesh) -> NDArray[np.int64]:
    """Faces in numbers of places: vertices at the same place have the same."""
    bits = np.ascontiguousarray(mesh.vertices.astype(np.float32)).view(np.uint32).astype(np.uint64)
    primes = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    mixed = (bits + np.uint64(1)) * primes
    mixed ^= mixed >> np.uint64(29)
    key = (mixed * primes[::-1]).sum(axis=1)
    _, first, place = np.unique(key, return_index=True, return_inverse=True)
    if not np.array_equal(mesh.vertices[first[place]], mesh.vertices):  # two places of one key
        _, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    welded: NDArray[np.int64] = place.reshape(-1)[mesh.faces]
    return welded


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges that two faces share; edges of one face or of more than two are not among them.

    Attributes
    ----------
    first, second : ndarray, shape (E,)
        The edge in each of its two faces: 3·face + corner at which it starts.
    agree : ndarray of bool, shape (E,)
        Whether it runs in opposite directions in the two, as between faces with the same winding.
    is_closed : bool
        Whether every edge of the mesh is among them.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    agree: NDArray[np.bool_]
    is_closed: bool

    @classmethod
    def of(cls, welded: NDArray[np.int64], count: int) -> _Edges:
        start, end = welded.ravel(), np.roll(welded, -1, axis=1).ravel()
        key = np.minimum(start, end) * (int(welded.max()) + 1) + np.maximum(start, end)
        order = np.argsort(key, kind="stable")
        key = key[order]
        same = np.concatenate([[False], key[1:] == key[:-1], [False]])  # whether each equals the one before it
        pair = np.flatnonzero(same[1:-1] & ~same[:-2] & ~same[2:])
        first, second = order[pair], order[pair + 1]
        return cls(first, second, start[first] == end[second], 2 * len(pair) == 3 * count)


def _wound(mesh: TriangleMesh, edges: _Edges) -> tuple[TriangleMesh, int]:
    """Mesh with consistent windings, outward where closed, and the number of faces turned.

    Each face is taken twice, as it is and turned; faces that fit are linked. A connected surface has two such sheets,
    one the reverse of the other, or only one if it cannot be oriented: that one is left alone.
    """
    count = len(mesh.faces)
    turned = np.zeros(count, bool)
    f, g = edges.first // 3, edges.second // 3
    if not edges.agree.all():
        offset = np.where(edges.agree, 0, count)
        rows, columns = np.concatenate([f, f + count]), np.concatenate([g + offset, g + (count - offset)])
        sheet = _components(rows, columns, 2 * count)
        # ---- The sheet on which fewer faces are turned ----
        upright = np.bincount(sheet[:count], minlength=int(sheet.max()) + 1)
        here, there = sheet[:count], sheet[count:]
        turned = (upright[there] > upright[here]) | ((upright[there] == upright[here]) & (there < here))
    if edges.is_closed:
        a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.vertices.mean(axis=0) for k in range(3))
        volume = (a * np.cross(b, c)).sum(axis=1) * np.where(turned, -1, 1)
        # One surface inside another may bound a cavity: only a mesh that is inside out as a whole is turned
        turned ^= bool(volume.sum() < 0)
    if not turned.any():
        return mesh, 0
    faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    return replace(mesh, faces=faces), int(turned.sum())


def _with_creases(mesh: TriangleMesh, edges: _Edges) -> TriangleMesh:
    """Mesh with normals that are smooth across all edges but the sharp ones, where its vertices are split."""
    normal, angle = _faces_and_angles(mesh)
    is_smooth = edges.agree & (
        (normal[edges.first // 3] * normal[edges.second // 3]).sum(axis=1) > math.cos(math.radians(CREASE_DEG))
    )
    first, second = edges.first[is_smooth], edges.second[is_smooth]
    rows, columns = np.concatenate([first, _next(first)]), np.concatenate([_next(second), second])
    vertex = _components(rows, columns, 3 * len(mesh.faces))
    count = int(vertex.max()) + 1
    positions = np.empty((count, 3))  # all are written
    positions[vertex] = mesh.vertices[mesh.faces.ravel()]
    summed = _summed(vertex, normal, angle, count)
    return TriangleMesh(positions, vertex.reshape(-1, 3), _unit(summed))


def _with_mended_normals(mesh: TriangleMesh, given: NDArray[np.float64], name: str, notes: list[str]) -> TriangleMesh:
    normal, angle = _faces_and_angles(mesh)
    ours = _unit(_summed(mesh.faces.ravel(), normal, angle, len(mesh.vertices)))
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    usable = _usable(given)
    theirs = _unit(np.where(usable[:, None], given, ours))
    against = used & ((theirs * ours).sum(axis=1) < 0)
    against[against] = ~_fits_a_face(mesh, normal, theirs)[against]
    for is_so, what in (
        (used & ~usable, "zero or no number, and computed"),
        (against, "against their faces, and flipped"),
    ):
        if count := int(is_so.sum()):
            notes.append(f"'{name}': {_share(count, int(used.sum()), 'vertex normal')} {what}")
    return replace(mesh, normals=np.where(against[:, None], -theirs, theirs))


def _fits_a_face(mesh: TriangleMesh, normal: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether each vertex normal is on the outer side of any of its faces."""
    fits = np.zeros(len(n), bool)
    for corner in range(3):
        vertex = mesh.faces[:, corner]
        fits[vertex[(n[vertex] * normal).sum(axis=1) > 0]] = True
    return fits


def _faces_and_angles(mesh: TriangleMesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals of the faces, shape (F, 3), and angles at their corners, shape (F, 3)."""
    corners = [mesh.vertices[mesh.faces[:, k]] for k in range(3)]
    along = [_unit(corners[(k + 1) % 3] - corners[k]) for k in range(3)]
    # The cross product of unit edges neither overflows nor vanishes
    normal = _unit(np.cross(along[0], -along[2]))
    cosine = np.stack([-(along[k] * along[k - 1]).sum(axis=1) for k in range(3)], axis=1)
    return normal, np.arccos(np.clip(cosine, -1, 1))


def _summed(
    vertex: NDArray[np.int64], normal: NDArray[np.float64], angle: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    columns = [np.bincount(vertex, (normal[:, axis, None] * angle).ravel(), count) for axis in range(3)]
    return np.stack(columns, axis=1)


def _usable(normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    length = np.linalg.norm(normals, axis=1)
    usable: NDArray[np.bool_] = np.isfinite(length) & (length > _LEAST_NORMAL)
    return usable


def _components(rows: NDArray[np.int64], columns: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(count, count))
    labels: NDArray[np.int64] = connected_components(graph, directed=False)[1].astype(np.int64)
    return labels


def _next(half_edge: NDArray[np.int64]) -> NDArray[np.int64]:
    """Corner at which an edge ends."""
    return np.where(half_edge % 3 == 2, half_edge - 2, half_edge + 1)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
