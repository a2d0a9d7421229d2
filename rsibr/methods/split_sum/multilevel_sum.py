"""Sums of a GGX kernel over all light, in any direction: multilevel summation over charts of halving resolution.

Kernel sums ∫ K(r·l) L(l) dω are split over length scales. Level j holds the light in charts of spacing h_j = 2ʲ h_0 and
sums K_j = T_{j−1} − T_j, where T_j is the kernel softened inside R_j = `REACH` h_j (and T_{−1} the kernel itself): it
vanishes beyond R_j, so that a window of a fixed number of nodes holds all of it. The last level sums T_j over the whole
sphere. Every K_j is smooth on its own grid; cubic interpolation brings light to the nodes and sums back from them, so
that errors are relative to the kernel where it is summed: a faint sky next to a sun keeps its own. (Brandt & Lubrecht
1990; known as multilevel summation from Coulomb forces, Skeel et al. 2002.)

The last level holds the kernel's kink at the horizon, where cubic weights would ring: there light is merged into the
centroids of cells, which no weight is negative of and a single lamp keeps its place in, and the variance of each cell's
light corrects the sum to second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.methods.split_sum.cube_charts import (
    AXES,
    FACES,
    interpolated,
    node_tangents,
    place_in_face,
    places_in_charts,
    spread,
)
from rsibr.methods.split_sum.ggx_kernel import GGXKernel, SoftenedKernel

Array = NDArray[np.float64]

REACH = 10.0
"""Softening radius of a level in spacings of its nodes."""

COARSEST = 48
"""Nodes a side of a face up to which the rest of the kernel is summed over the whole sphere."""

FINENESS = 2.5
"""Nodes a side of a face times α on the finest level: three of them in the kernel's half-width 2α."""

FINEST = 256
"""Nodes a side of a face, at most."""

FEWEST = 32
"""Nodes a side of a face, at least: of the kink at the horizon."""

CELLS = 48
"""Cells a side of a face into which light is merged for the last level."""

_BORDER = 2  # nodes beyond a face that cubic interpolation inside of it needs


@dataclass(frozen=True, eq=False)
class PointSources:
    """Point sources of light.

    Attributes
    ----------
    directions : ndarray, shape (n, 3)
        Unit directions.
    weights : ndarray, shape (n, 4)
        Radiance times solid angle in three channels, and solid angle [sr].
    """

    directions: Array
    weights: Array

    @cached_property
    def merged(self) -> tuple[Array, Array]:
        """Sources of the last level: light about its centroids, and solid angle about its own; see `_centroids`.

        Solid angle at the centroids of light would crowd around lamps, and darken them where sums are divided by it.
        """
        light, angle = self.weights * [1, 1, 1, 0], self.weights * [0, 0, 0, 1]
        level = max(float(light.sum() / angle.sum()), 1e-30)
        bright = light.sum(axis=1) + 1e-6 * level * angle[:, 3]  # a direction for cells without light too
        masses = (light, bright, CELLS), (angle, angle[:, 3], 2 * CELLS // 3)
        pair = [_centroids(self.directions, *one) for one in masses]
        return np.concatenate([centres for centres, _ in pair]), np.concatenate([sums for _, sums in pair])


@dataclass(eq=False)
class Level:
    """Sums of one part of the kernel at the nodes of all charts.

    Attributes
    ----------
    size : int
        Nodes a side of a face.
    sums : mi.Float
        Shape (6, size + 4, size + 4, 4), flat.
    """

    size: int
    sums: mi.Float

    def at(self, face: mi.UInt32, place: mi.Point2f) -> mi.Vector4f:
        """Sum at a place of a chart."""
        return interpolated(self.sums, self.size, _BORDER, face, place)


def level_sums(sources: PointSources, kernel: GGXKernel, finest: int) -> list[Level]:
    """Sum a kernel over point sources.

    Parameters
    ----------
    sources : PointSources
        Light.
    kernel : GGXKernel
        Kernel; the sums are without its factor α²/(4π).
    finest : int
        Nodes a side of a face on the finest level: see `finest_size`.

    Returns
    -------
    list of Level
        Their sum at a direction is the sum over the sources; see `summed`.
    """
    directions, weights = sources.directions, sources.weights
    levels, size, inner = list[Level](), finest, SoftenedKernel.of(kernel, 0.0)
    while size > COARSEST:
        outer = SoftenedKernel.of(kernel, REACH * np.pi / (2 * size))
        levels.append(Level(size, _window_sums(directions, weights, size, inner, outer)))
        size, inner = (size + 1) // 2, outer
        if size > COARSEST:
            directions, weights = _merged(directions, weights, 2 * size)
    return [*levels, Level(size, _whole_sums(*sources.merged, size, inner))]


def summed(levels: list[Level], d: mi.Vector3f) -> mi.Vector4f:
    """Sum of all levels in unit directions."""
    face, place = place_in_face(d)
    total = mi.Vector4f(0)
    for level in levels:
        total += level.at(face, place)
    return total


def finest_size(alpha: float) -> int:
    """Nodes a side of a face that resolve a kernel of roughness `alpha`."""
    return int(np.clip(np.ceil(FINENESS / alpha), FEWEST, FINEST))


def _merged(directions: Array, weights: Array, size: int) -> tuple[Array, Array]:
    """Sources at the nodes of a level in place of more sources."""
    nodes = FACES * (size + 2 * _BORDER) ** 2
    if nodes >= len(directions):
        return directions, weights
    point, face, place = places_in_charts(directions, 0.0)
    held = spread(place, face, weights[point], size, _BORDER).reshape(-1, weights.shape[1])
    used = held.any(axis=1)
    return node_directions(size, _BORDER)[used], held[used].astype(np.float64)


def _centroids(directions: Array, weights: Array, mass: Array, size: int) -> tuple[Array, Array]:
    """Sources merged by the cell of a chart that they lie in.

    Returns
    -------
    centres : ndarray, shape (cells, 4)
        Unit direction of the centroid of each cell's mass, and its variance [rad²] along one axis.
    sums : ndarray, shape (cells, 4)
        Sum of the weights.
    """
    point, face, place = places_in_charts(directions, 0.0)
    column, row = np.clip((place.T + 1) * (0.5 * size), 0, size - 1).astype(np.intp)
    cell = (face * size + row) * size + column
    values = np.concatenate([directions * mass[:, None], mass[:, None], weights], axis=1)[point]
    held = np.stack([np.bincount(cell, one, FACES * size * size) for one in values.T], axis=1)
    held = held[held[:, 3] > 0]
    mean = held[:, :3] / held[:, 3:4]
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    centres = np.concatenate([mean / length, np.maximum(1 - length**2, 0) / 2], axis=1)
    return centres, np.asarray(held[:, 4:], dtype=np.float64)


def node_directions(size: int, margin: int) -> Array:
    """Unit directions of the nodes of all charts, row-major over face, v, u; shape (nodes, 3)."""
    tangent = node_tangents(size, margin)
    right, up = np.meshgrid(tangent, tangent)
    local = np.stack([right, up, np.ones_like(right)], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    return np.concatenate([local.reshape(-1, 3) @ axes for axes in AXES])


def window_nodes(size: int) -> int:
    """Nodes to either side of a node that hold all sources within the softening radius of a level."""
    radius = REACH * np.pi / (2 * size)
    edge = np.tan(np.pi / 4 * (1 + (2 * _BORDER - 1) / size))
    around = np.linspace(0, 2 * np.pi, 256)
    most = 0.0
    for x, y in ((0, 0), (edge, 0), (edge, edge)):
        middle = np.array([x, y, 1]) / np.sqrt(x * x + y * y + 1)
        right = np.cross([0, 1.0, 0], middle)
        right /= np.linalg.norm(right)
        ring = np.outer(np.cos(around), right) + np.outer(np.sin(around), np.cross(middle, right))
        circle = np.cos(radius) * middle + np.sin(radius) * ring
        offset = np.arctan(circle[:, :2] / circle[:, 2:]) - np.arctan([x, y])
        most = max(most, float(np.abs(offset).max()) * 2 * size / np.pi)
    return int(np.ceil(most))


def _window_sums(
    directions: Array, weights: Array, size: int, inner: SoftenedKernel, outer: SoftenedKernel
) -> mi.Float:
    """Sums over the nodes within `window_nodes`, of the difference of two softened kernels."""
    # ---- Light at the nodes of overlapping charts ----
    reach = window_nodes(size)
    margin = _BORDER + reach + 4  # of the last nodes stencils reach beyond the window
    point, face, place = places_in_charts(directions, 2 * (margin - 2) / size)
    light = to_device(mi.Float, spread(place, face, weights[point], size, margin))
    tangents = to_device(mi.Float, node_tangents(size, margin).astype(np.float32))
    # ---- One lane a node of the output; a loop over its window ----
    side, row, window, first, count = (
        dr.opaque(mi.UInt32, value)
        for value in (
            size + 2 * _BORDER,
            size + 2 * margin,
            2 * reach + 1,
            margin - _BORDER - reach,
            (2 * reach + 1) ** 2,
        )
    )
    lane = dr.arange(mi.UInt32, FACES * (size + 2 * _BORDER) ** 2)
    face_of, left, low = lane // (side * side), lane % side + first, (lane // side) % side + first
    half = (window - 1) // 2
    r = _direction(tangents, left + half, low + half)

    def add(k: mi.UInt32, total: mi.Vector4f) -> tuple[mi.UInt32, mi.Vector4f]:
        column, line = left + k % window, low + k // window
        away = _direction(tangents, column, line) - r
        s = 0.25 * dr.squared_norm(away)  # without the cancellation of 1 − cos θ
        value = (inner.at(s) - outer.at(s)) * dr.maximum(1 - 2 * s, 0)
        return k + 1, total + dr.gather(mi.Vector4f, light, (face_of * row + line) * row + column) * value

    _, total = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.Vector4f, dr.width(lane))),
        cond=lambda k, _total: k < count,
        body=add,
        labels=("k", "total"),
        label="window_sums",
    )
    return _flat(total)


def _whole_sums(centres: Array, weights: Array, size: int, kernel: SoftenedKernel) -> mi.Float:
    """Sums over all merged sources (`_centroids`) of a softened kernel."""
    rows = np.concatenate([centres, weights], axis=1)
    table, count = to_device(mi.Float, rows.astype(np.float32)), dr.opaque(mi.UInt32, len(rows))
    r = mi.Vector3f(np.ascontiguousarray(node_directions(size, _BORDER).T, dtype=np.float32))

    def add(k: mi.UInt32, total: mi.Vector4f) -> tuple[mi.UInt32, mi.Vector4f]:
        d, weight = (dr.gather(mi.Vector4f, table, 2 * k + half) for half in range(2))
        s = 0.25 * dr.squared_norm(mi.Vector3f(d.x, d.y, d.z) - r)
        return k + 1, dr.fma(weight, kernel.mean_at(s, d.w), total)

    _, total = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.Vector4f, dr.width(r))),
        cond=lambda k, _total: k < count,
        body=add,
        labels=("k", "total"),
        label="whole_sums",
    )
    return _flat(total)


def _direction(tangents: mi.Float, column: mi.UInt32, line: mi.UInt32) -> mi.Vector3f:
    """Unit direction of a node in the axes of its face."""
    x, y = dr.gather(mi.Float, tangents, column), dr.gather(mi.Float, tangents, line)
    return mi.Vector3f(x, y, 1) * dr.rsqrt(dr.fma(x, x, dr.fma(y, y, 1)))


def _flat(values: mi.Vector4f) -> mi.Float:
    """Four channels a node, flat, evaluated."""
    flat = dr.ravel(values)
    dr.eval(flat)
    return flat
