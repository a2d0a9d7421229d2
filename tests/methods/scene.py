"""A mirror and a matte sphere under a smooth analytic sky, as stored maps: no renderer, no noise."""

import numpy as np

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.geometry.spherical import area_weights
from rsibr.geometry.viewpoints import icosphere
from rsibr.methods.warp_blend.blend import triangle_mix
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import MirrorWarp
from rsibr.methods.warp_blend.warp_blend import WarpBlend
from tests.arrays import disk_grid


def sky(direction):
    """Radiance of an asymmetric sky, a polynomial of the direction (..., 3)."""
    x, y, z = np.moveaxis(direction, -1, 0)
    return np.stack([1.5 + x, 1.5 + 0.5 * y + 0.5 * x * z, 2 + y * z], axis=-1)


def normals(frame, resolution):
    """World normals at the texel centres, those outside the disk pulled to the rim; (N, N, 3)."""
    x, y = disk_grid(resolution)
    shrink = np.maximum(1, np.hypot(x, y))
    x, y = x / shrink, y / shrink
    return np.stack([x, y, np.sqrt(np.maximum(0, 1 - x * x - y * y))], axis=-1) @ frame.T


def mirror_sphere(frame, resolution):
    """What a perfect mirror shows: the sky in the direction of reflection."""
    n, v = normals(frame, resolution), frame[:, 2]
    return sky(2 * (n @ v)[..., None] * n - v).astype(np.float32)


def matte_sphere(frame, resolution):
    """What depends on the normal alone."""
    return sky(normals(frame, resolution)).astype(np.float32)


def stored(sphere, resolution, subdivision=0):
    """Viewpoints and their maps of `sphere`."""
    views = icosphere(subdivision)
    frames = [view_frame(direction) for direction in views.directions]
    coverage = np.tile(texel_coverage(resolution).astype(np.float32), (len(frames), 1, 1))
    return views, SourceMaps.from_arrays(np.stack([sphere(f, resolution) for f in frames]), coverage, np.stack(frames))


def method(sphere=mirror_sphere, resolution=64, *, warp=MirrorWarp, mix=None, subdivision=0, kind=WarpBlend):
    """A method over the stored maps of `sphere`; by default the paper's."""
    views, sources = stored(sphere, resolution, subdivision)
    return kind("test", views, sources, mix or triangle_mix(area_weights), warp)


def image(made, frame, resolution):
    """The map that a method makes, as (N, N, 3) of float64."""
    return made.map(frame, resolution).numpy()[..., :3].astype(np.float64)


def inside(resolution, radius=1.0):
    """Texels whose centre lies within `radius`."""
    return np.hypot(*disk_grid(resolution)) < radius
