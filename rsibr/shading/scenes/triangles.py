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
"""Quads along azimuth and polar angle of a sphere, a cylinder or a disk; a silhouette is then off by 3e-4 radii."""

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
    """Grid over azimuth and polar angle, height or radius, carried by the shape's own transform."""
    columns, rows = _GRID
    grid = np.meshgrid(np.linspace(0, 2 * np.pi, columns + 1), np.linspace(0, 1, rows + 1))
    turn, share = (one.ravel() for one in grid)
    around, nothing = np.stack([np.cos(turn), np.sin(turn)]), np.zeros_like(turn)
    kind = shape.class_name().lower()
    if kind == "sphere":
        polar = np.pi * share
        place = normal = np.stack([*(np.sin(polar) * around), np.cos(polar)])
    elif kind == "cylinder":
        place, normal = np.stack([*around, share]), np.stack([*around, nothing])
    else:
        place, normal = np.stack([*(share * around), nothing]), np.stack([nothing, nothing, nothing + 1])
    matrix = np.array(mi.traverse(shape)["to_world"].matrix, np.float64).reshape(4, 4)
    vertices = (matrix[:3, :3] @ place).T + matrix[:3, 3]
    normals = (np.linalg.inv(matrix[:3, :3]).T @ normal).T
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = corner + columns + 1
    faces = np.concatenate([np.stack([corner, corner + 1, below], 1), np.stack([below, corner + 1, below + 1], 1)])
    return TriangleMesh(vertices, faces, normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _rows(vectors: mi.Vector3f, count: int) -> NDArray[np.float64]:
    """Vectors of all lanes, shape (count, 3)."""
    return np.array(vectors, np.float64).T.reshape(count, 3)
