"""Triangles of a scene's shapes on the host, for programs that draw triangles only."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.shading.scenes.mesh_repair import TriangleMesh
from rsibr.shading.scenes.object_scene import ObjectScene

_GRID = (128, 64)
"""Quads along the parameters u and v of a sphere, a cylinder or a disk; a silhouette is then off by 3e-4 radii."""

_INSET = 1e-5
"""Parameters keep this distance from 0 and 1, where Mitsuba finds no point of a cylinder."""

_ROUND = ("sphere", "cylinder", "disk")


@backend.in_session
def triangle_meshes(scene: ObjectScene) -> dict[str, TriangleMesh]:
    """Triangles of every shape, in world coordinates, with unit normals at their vertices.

    Parameters
    ----------
    scene : ObjectScene
        Meshes are taken as they are; spheres, cylinders and disks are tessellated.

    Returns
    -------
    dict of str to TriangleMesh
        By shape id. A mesh without vertex normals has the normals of its faces, and three vertices a triangle.

    Raises
    ------
    InputError
        If a shape is of another kind.

    Examples
    --------
    >>> from rsibr.shading.scenes.scene_file import open_scene
    >>> ball = triangle_meshes(open_scene("sphere"))["sphere"]
    >>> len(ball.faces), float(np.linalg.norm(ball.vertices, axis=1).max().round(6))
    (16384, 1.0)
    """
    return {name: _triangles(shape, name, scene.name) for name, shape in scene.shapes.items()}


def _triangles(shape: mi.Shape, name: str, where: str) -> TriangleMesh:
    if shape.is_mesh():
        return _of_mesh(shape)
    if shape.class_name().lower() in _ROUND:
        return _tessellated(shape)
    fix = "give a mesh, a sphere, a cylinder or a disk in its place"
    raise InputError(f"the shape '{name}' ({shape.class_name()}) has no triangles", where=where, fix=fix)


def _of_mesh(mesh: mi.Mesh) -> TriangleMesh:
    vertex = dr.arange(mi.UInt32, mesh.vertex_count())
    vertices = _rows(mesh.vertex_position(vertex), mesh.vertex_count())
    faces = np.array(mesh.face_indices(dr.arange(mi.UInt32, mesh.face_count())), np.int64).T.reshape(-1, 3)
    if mesh.has_vertex_normals():
        return TriangleMesh(vertices, faces, _rows(mesh.vertex_normal(vertex), mesh.vertex_count()))
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    apart = np.arange(3 * len(faces)).reshape(-1, 3)
    return TriangleMesh(vertices[faces.ravel()], apart, np.repeat(normal, 3, axis=0))


def _tessellated(shape: mi.Shape) -> TriangleMesh:
    columns, rows = _GRID
    u, v = np.meshgrid(np.linspace(_INSET, 1 - _INSET, columns + 1), np.linspace(_INSET, 1 - _INSET, rows + 1))
    place = mi.Point2f(mi.Float(u.ravel().astype(np.float32)), mi.Float(v.ravel().astype(np.float32)))
    at = shape.eval_parameterization(place, mi.RayFlags.All)
    dr.eval(at.p, at.n)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = corner + columns + 1
    faces = np.concatenate([np.stack([corner, corner + 1, below], 1), np.stack([below, corner + 1, below + 1], 1)])
    return TriangleMesh(_rows(at.p, u.size), faces, _rows(at.n, u.size))


def _rows(vectors: mi.Vector3f, count: int) -> NDArray[np.float64]:
    """Vectors of all lanes, shape (count, 3); a disk has one normal for all."""
    return np.broadcast_to(np.array(vectors, np.float64).T.reshape(-1, 3), (count, 3)).copy()
