"""Exact maps of a mirror under a sky of smooth lobes: what every judgement can be held against."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import stored_coverage


def sky(directions):
    """Radiance of 60 lobes of 10 to 25°, in R, G, B."""
    rng = np.random.default_rng(11)
    axes = rng.normal(size=(60, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    sharp = 1 / np.radians(rng.uniform(10, 25, 60)) ** 2
    colours = rng.uniform(0.1, 1, (60, 3))
    return 0.1 + np.exp((directions @ axes.T - 1) * sharp) @ colours


def uneven(count, seed=1):
    rng = np.random.default_rng(seed)
    k = np.arange(count) + 0.5
    up, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    views = np.stack([np.sqrt(1 - up**2) * np.cos(turn), up, np.sqrt(1 - up**2) * np.sin(turn)], axis=1)
    views = views + 0.2 * rng.normal(size=views.shape)
    return views / np.linalg.norm(views, axis=1, keepdims=True)


def mirror_map(view, resolution=64, moved=None, frame=None):
    """Map of a view; `moved` is a rotation of the camera that its pose does not know."""
    centre = (np.arange(resolution) + 0.5) * 2 / resolution - 1
    x, y = np.meshgrid(centre, -centre)
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    local = np.stack([2 * x * z, 2 * y * z, 2 * z * z - 1], axis=-1)
    axes = view_frame(view) if frame is None else frame
    world = local @ ((np.eye(3) if moved is None else moved) @ axes).T
    return (sky(world.reshape(-1, 3)).reshape(*x.shape, 3) * (stored_coverage(resolution) > 0)[..., None]).astype(
        np.float32
    )


def turned(degrees, axis=(1, 2, 0.5)):
    axis = np.array(axis, dtype=float)
    return Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()
