"""Meshes that the tests of shading share: smooth closed surfaces with exact normals, as shapes and as arrays."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from rsibr.resources import scenes
from rsibr.shading.scenes.mesh_file import as_shape
from rsibr.shading.scenes.mesh_repair import TriangleMesh
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.scenes.scene_file import open_scene


def torus_mesh(rows: int = 96, columns: int = 48, radius: float = 1.0, tube: float = 0.4) -> TriangleMesh:
    """Torus around the y axis with exact normals; it hides parts of the sky from itself."""
    u, v = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in (rows, columns)), indexing="ij")
    n = np.stack([np.cos(v) * np.cos(u), np.sin(v), np.cos(v) * np.sin(u)], -1).reshape(-1, 3)
    ring = radius * np.stack([np.cos(u), 0 * u, np.sin(u)], -1).reshape(-1, 3)
    return TriangleMesh(ring + tube * n, _grid_faces(rows, columns), n)


def bumpy_mesh(subdivisions: int = 4, height: float = 0.12) -> TriangleMesh:
    """Sphere with bumps, radius 1 + h·sin 3x·sin 3y·sin 3z, and its exact normals."""
    sphere = trimesh.creation.icosphere(subdivisions)
    d = np.asarray(sphere.vertices, dtype=np.float64)
    s, c = np.sin(3 * d), np.cos(3 * d)
    radius = 1 + height * s.prod(axis=1, keepdims=True)
    slope = 3 * height * c * np.stack([s[:, 1] * s[:, 2], s[:, 0] * s[:, 2], s[:, 0] * s[:, 1]], -1)
    tangential = slope - (slope * d).sum(axis=1, keepdims=True) * d
    n = radius * d - tangential
    return TriangleMesh(radius * d, np.asarray(sphere.faces), n / np.linalg.norm(n, axis=1, keepdims=True))


def capsule_mesh(count: int = 48, height: float = 2.0, radius: float = 0.7) -> TriangleMesh:
    """Capsule along z, convex, with its exact normals."""
    made = trimesh.creation.capsule(height=height, radius=radius, count=(count, count))
    vertices = made.vertices - made.vertices.mean(axis=0)
    core = np.clip(vertices[:, 2:], -height / 2, height / 2)
    n = np.concatenate([vertices[:, :2], vertices[:, 2:] - core], axis=1)
    return TriangleMesh(vertices, np.asarray(made.faces), n / np.linalg.norm(n, axis=1, keepdims=True))


def scene_of(name: str, mesh: TriangleMesh) -> ObjectScene:
    """Scene with one shape."""
    return ObjectScene(name, {name: as_shape(mesh, name)})


def _grid_faces(rows: int, columns: int) -> NDArray[np.int64]:
    i, j = (k.ravel() for k in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = (i + 1) % rows * columns + j, (i + 1) % rows * columns + (j + 1) % columns
    return np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, c], -1)])


@pytest.fixture(scope="session")
def torus(variant: str) -> ObjectScene:
    """Torus around the y axis, radii 1 and 0.4."""
    return scene_of("torus", torus_mesh())


@pytest.fixture(scope="session")
def bumpy(variant: str) -> ObjectScene:
    """Bumpy sphere, radius about 1."""
    return scene_of("bumpy", bumpy_mesh())


@pytest.fixture(scope="session")
def capsule(variant: str) -> ObjectScene:
    """Capsule along z, radius 0.7, length 3.4."""
    return scene_of("capsule", capsule_mesh())


@pytest.fixture(scope="session")
def sphere(variant: str) -> ObjectScene:
    """Unit sphere."""
    return open_scene("sphere")


@pytest.fixture(scope="session")
def car(variant: str) -> ObjectScene:
    """Demo car, as shipped: body, rubber, metal, glass."""
    return open_scene(scenes() / "objects" / "car.xml")


def rays_toward(origin: NDArray[np.float64], target: NDArray[np.float64]) -> mi.Ray3f:
    """Rays from points to points, shape (N, 3) each."""
    direction = target - origin
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return mi.Ray3f(mi.Point3f(*origin.T.astype(np.float32)), mi.Vector3f(*direction.T.astype(np.float32)))
