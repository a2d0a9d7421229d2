"""Zones of a picture: silhouette, curved, flat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.shading.cameras.camera import Camera
from rsibr.shading.pictures.picture import Picture

ZONES = ("silhouette", "curved", "flat")
"""Each covered pixel is in one."""

CURVED = 0.005
"""Turn of the normal from a pixel to its neighbour from which it is curved [rad]: a sphere of 200 pixels' radius."""

NORMAL_JUMP = 0.5
"""Turn of the normal between neighbours from which there is an edge [rad]."""

DEPTH_JUMP = 8.0
"""Second difference of the depth, in widths of a pixel at that depth, from which one surface hides another."""

Mask = NDArray[np.bool_]

_ALL, _FIRST, _SECOND = slice(None), slice(None, -1), slice(1, None)
_NEIGHBOURS = (((_ALL, _FIRST), (_ALL, _SECOND)), ((_FIRST, _ALL), (_SECOND, _ALL)))
"""Both halves of all pairs of neighbours: side by side, and one above the other."""


def zones_of(layers: Picture, camera: Camera) -> dict[str, Mask]:
    """Zone of each pixel.

    Parameters
    ----------
    layers : Picture
        Coverage, depth and normals.
    camera : Camera
        Camera of the picture.

    Returns
    -------
    dict of str to ndarray of bool, shape (H, W)
        By `ZONES`: *silhouette* has a ray that misses, or a neighbour across an edge (`NORMAL_JUMP`, `DEPTH_JUMP`);
        of the other covered pixels, *curved* are those whose normal turns by `CURVED` or more to a neighbour.
    """
    covered = layers.alpha > 0
    silhouette = covered & ((layers.alpha < 1) | (turns(layers, covered) >= NORMAL_JUMP) | _hides(layers, camera))
    inner = covered & ~silhouette  # normals at an edge are means of both of its sides: no curvature
    curved = inner & (turns(layers, inner) >= CURVED)
    return dict(zip(ZONES, (silhouette, curved, inner & ~curved), strict=True))


def turns(layers: Picture, among: Mask) -> NDArray[np.float64]:
    """Largest angle between the normals of a pixel and its four neighbours, both `among` those, shape (H, W) [rad]."""
    normal = layers.normal.astype(np.float64)
    largest = np.zeros(among.shape)
    for here, there in _NEIGHBOURS:
        chord = np.linalg.norm(normal[here] - normal[there], axis=-1)  # exact for small angles, unlike the arccosine
        angle = np.where(among[here] & among[there], 2 * np.arcsin(np.minimum(chord / 2, 1)), 0)
        for side in (here, there):
            largest[side] = np.maximum(largest[side], angle)
    return largest


def _hides(layers: Picture, camera: Camera) -> Mask:
    """Pixels at a step of the depth, on both of its sides."""
    with np.errstate(invalid="ignore"):
        depth = np.where(layers.alpha > 0, layers.depth, np.nan).astype(np.float64)
        width = 2 * camera.half_width * camera.window[2] / camera.width * depth
        found = np.zeros(depth.shape, dtype=np.bool_)
        for axis in (0, 1):
            before, middle, after = (_shifted(depth, axis, by) for by in (-1, 0, 1))
            step = np.abs(before - 2 * middle + after) > DEPTH_JUMP * width  # NaN beside uncovered pixels: no step
            found |= step
    return found


def _shifted(values: NDArray[np.float64], axis: int, by: int) -> NDArray[np.float64]:
    """Neighbour of each pixel along an axis; NaN beyond the picture."""
    padded = np.pad(values, [(1, 1) if a == axis else (0, 0) for a in range(2)], constant_values=np.nan)
    return np.take(padded, np.arange(values.shape[axis]) + 1 + by, axis=axis)
