"""The paper's reconstruction once more, in float64 with NumPy, from the formulas: nothing of the package is used."""

from __future__ import annotations

import numpy as np


def _normalised(rows):
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def solid_angle(a, b, c):
    """Spherical excess (n,) by L'Huilier's theorem, of triangles given by rows."""

    def side(p, q):
        return 2 * np.arcsin(np.minimum(np.linalg.norm(p - q, axis=-1) / 2, 1))

    x, y, z = side(b, c), side(c, a), side(a, b)
    s = (x + y + z) / 2
    product = np.tan(s / 2) * np.tan((s - x) / 2) * np.tan((s - y) / 2) * np.tan((s - z) / 2)
    return 4 * np.arctan(np.sqrt(np.maximum(product, 0)))


def surrounding(directions, triangles, v):
    """Indices of the triangle that v lies deepest in, by looking at all of them."""
    a, b, c = np.moveaxis(directions[triangles], 1, 0)
    depth = np.min([_normalised(np.cross(p, q)) @ v for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return triangles[np.argmax(depth)]


def area_weights(corners, v):
    """Ratios (3,) of the areas that v cuts the triangle into."""
    a, b, c = corners
    areas = np.array([solid_angle(v, b, c), solid_angle(v, c, a), solid_angle(v, a, b)])
    return areas / areas.sum()


def bilinear(image, p):
    """Lookup in an image (N, N, 3) at disk points (n, 2); half a texel beyond the outermost centres those go on."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    x, y = (1 + p[:, 0]) * len(image) / 2 + 0.5, (1 - p[:, 1]) * len(image) / 2 + 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    u, w = (x - left)[:, None], (y - top)[:, None]
    upper = (1 - u) * padded[top, left] + u * padded[top, left + 1]
    lower = (1 - u) * padded[top + 1, left] + u * padded[top + 1, left + 1]
    return (1 - w) * upper + w * lower


def normals(frame, resolution):
    """World normals (N², 3) at the texel centres, taken radially to the rim where they lie outside."""
    centre = (np.arange(resolution) + 0.5) / resolution * 2 - 1
    x, y = np.meshgrid(centre, -centre)
    shrink = np.maximum(1, np.hypot(x, y))
    x, y = x / shrink, y / shrink
    return np.stack([x, y, np.sqrt(np.maximum(0, 1 - x * x - y * y))], axis=-1).reshape(-1, 3) @ frame.T


def cabral1999(directions, triangles, maps, frames, frame):
    """Radiance (N, N, 3) of the view `frame`: mirror warp, area weights, linear fade over one radius.

    Cabral et al. (1999), sections 3.3 and 3.4: the source is looked up at the half vector of the mirror direction and
    its own view; it fades with the distance, in the destination's map, from where the destination mirrors into −v_s.
    """
    resolution, v = maps.shape[1], frame[:, 2]
    n = normals(frame, resolution)
    r = 2 * (n @ v)[:, None] * n - v
    index = surrounding(directions, triangles, v)
    weights = area_weights(directions[index], v)
    radiance, total = np.zeros((resolution**2, 3)), np.zeros((resolution**2, 1))
    for source, weight in zip(index, weights, strict=True):
        v_s = frames[source][:, 2]
        p = (_normalised(r + v_s) @ frames[source])[:, :2]
        offset = (n - _normalised(v - v_s)) @ frame
        trusted = weight * np.minimum(np.hypot(offset[:, 0], offset[:, 1]), 1)[:, None]
        radiance += trusted * bilinear(maps[source], p)
        total += trusted
    return (radiance / total).reshape(resolution, resolution, 3)
