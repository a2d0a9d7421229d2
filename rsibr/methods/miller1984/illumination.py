"""Illumination table I of Miller & Hoffman (1984), section 5: mean radiance by polar coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles
from rsibr.light.radiance import Light
from rsibr.methods.miller1984.convolution import texel_areas

Array = NDArray[np.float64]


def illumination_table(light: Light, rows: int) -> Array:
    """Mean radiance of a bake's light over each texel, lights without extent included."""
    from scipy.ndimage import map_coordinates  # TEMPORARY until projections
    v = (np.arange(rows) + .5) * np.pi / rows
    u = (np.arange(2 * rows) + .5) * np.pi / rows
    d = np.stack(np.broadcast_arrays(np.sin(v)[:, None] * np.sin(u), np.cos(v)[:, None], np.sin(v)[:, None] * np.cos(u)), -1)
    from rsibr.geometry.projections.octahedral import bordered
    s = np.abs(d).sum(-1)
    x, y = d[..., 0] / s, d[..., 1] / s
    b = d[..., 2] < 0
    sg = lambda a: np.where(a < 0, -1, 1)
    fx, fy = (1 - abs(y)) * sg(x), (1 - abs(x)) * sg(y)
    x, y = np.where(b, fx, x), np.where(b, fy, y)
    R = len(light.picture)
    p = bordered(light.picture)
    c, r = (x + 1) / 2 * R + .5, (y + 1) / 2 * R + .5
    t = np.stack([map_coordinates(p[..., k].astype(float), [r, c], order=1) for k in range(3)], -1)
    for dd, e in zip(light.delta.directions, light.delta.irradiance):
        uu = np.arctan2(dd[0], dd[2]) / (2 * np.pi) % 1
        vv = np.arctan2(np.hypot(dd[0], dd[2]), dd[1]) / np.pi
        i, j = min(int(vv * rows), rows - 1), min(int(uu * 2 * rows), 2 * rows - 1)
        t[i, j] += e / texel_areas(rows, 2 * rows)[i]
    return t
