"""Generator of the demo car: `python scenes/objects/make_car.py [FOLDER]` writes body, rubber, metal and glass as PLY.

The body is the zero level of a smooth function, met by rays from an axis within it; arches are cut along circles.
Windows, lamps and gaps are patches a few millimetres above it. Lengths in metres; +x forward, +y up, ground at y = 0.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Points = NDArray[np.float64]
Part = tuple[Points, Points, NDArray[np.int64]]
"""Vertices, unit normals and faces."""

WHEELS = (1.36, -1.30)
WHEEL_RADIUS, ARCH_RADIUS, AXLE_HEIGHT, TRACK = 0.335, 0.385, 0.335, 0.76
_AXIS_HEIGHT, _AXIS_ENDS = 0.68, (-1.55, 1.55)


def _curve(*points: tuple[float, float]) -> Callable[[Points], Points]:
    x, y = np.array(sorted(points)).T
    return CubicSpline(x, y, bc_type="natural")


# ---- Side view: bonnet, belt and boot; roof with both screens; half width at the belt ----
_DECK = _curve((-2.6, 0.86), (-2.2, 0.93), (-1.95, 0.965), (-1.5, 0.965), (-0.6, 0.93), (0.5, 0.90), (1.0, 0.875),
               (1.5, 0.79), (1.9, 0.70), (2.2, 0.59), (2.6, 0.35))  # fmt: skip
_ROOF = _curve((-2.6, 0.10), (-2.05, 0.72), (-1.6, 1.05), (-1.1, 1.245), (-0.6, 1.345), (-0.1, 1.37), (0.25, 1.33),
               (0.6, 1.18), (1.1, 0.91), (1.5, 0.66), (2.6, -0.1))  # fmt: skip
_HALF_WIDTH = _curve((-2.6, 0.66), (-2.1, 0.795), (-1.3, 0.895), (-0.4, 0.87), (0.4, 0.87), (1.3, 0.89), (1.9, 0.81),
                     (2.2, 0.70), (2.6, 0.52))  # fmt: skip
_SILL = _curve((-2.6, 0.42), (-2.1, 0.31), (-1.7, 0.2), (1.7, 0.19), (2.1, 0.21), (2.6, 0.3))


def _least(a: Points, b: Points, k: float) -> Points:
    """Smooth minimum, k wide."""
    h = np.clip(0.5 + 0.5 * (b - a) / k, 0, 1)
    blended: Points = b + (a - b) * h - k * h * (1 - h)
    return blended


def _most(a: Points, b: Points, k: float) -> Points:
    return -_least(-a, -b, k)


def body(p: Points) -> Points:
    """Function that is negative inside the body, about the distance to it; `p` has shape (..., 3)."""
    x, y, z = p[..., 0], p[..., 1], np.sqrt(p[..., 2] ** 2 + 1e-4)
    # ---- Lower body: sides with a shoulder, deck with a crown, sill, nose and tail rounded in plan ----
    side = z - _HALF_WIDTH(x) + 0.16 * (np.clip(y - 0.62, 0, None) / 0.35) ** 2 + 0.07 * ((y - 0.62) / 0.42) ** 2
    side -= 0.018 * np.exp(-(((y - 0.76) / 0.05) ** 2))
    deck = 0.95 * (y - _DECK(x) + 0.06 * (z / 0.8) ** 2)
    sill = _SILL(x) - y
    nose = x - (2.21 - 0.19 * (z / 0.8) ** 2 - 0.32 * (y - 0.48) ** 2 / 0.25)
    tail = -x - (2.17 - 0.14 * (z / 0.8) ** 2 - 0.16 * (y - 0.72) ** 2 / 0.1)
    lower = _most(_most(_most(side, deck, 0.07), sill, 0.08), _most(nose, tail, 0.05), 0.10)
    # ---- Greenhouse ----
    roof = 0.88 * (y - _ROOF(x) + 0.07 * (z / 0.6) ** 2)
    glasshouse = 0.9 * (z - 0.775 + 0.44 * (y - 0.92) + 0.035 * (x + 0.2) ** 2)
    cabin = _most(_most(roof, glasshouse, 0.10), 0.6 - y, 0.05)
    whole = _least(lower, cabin, 0.045)
    for centre in WHEELS:  # flares around the arches
        radius = np.hypot(x - centre, y - AXLE_HEIGHT)
        whole = whole - 0.020 * np.exp(-(((radius - ARCH_RADIUS) / 0.075) ** 2)) / (1 + np.exp(-(z - 0.6) / 0.03))
    return whole


def _normals(p: Points) -> Points:
    step = 2e-4
    offsets = step * np.eye(3)
    n = np.stack([body(p + d) - body(p - d) for d in offsets], axis=-1)
    return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))


def _met(origin: Points, direction: Points, start: float, end: float, steps: int = 160) -> Points:
    """Points at which rays first change sides."""
    inside = body(origin + start * direction) < 0
    low, high, found = np.full(origin.shape[:-1], start), np.full(origin.shape[:-1], end), np.zeros(inside.shape, bool)
    for t in np.linspace(start, end, steps):
        other = (body(origin + t * direction) < 0) != inside
        high, low = np.where(other & ~found, t, high), np.where(other | found, low, t)
        found |= other
    for _ in range(25):
        middle = 0.5 * (low + high)
        other = (body(origin + middle[..., None] * direction) < 0) != inside
        low, high = np.where(other, low, middle), np.where(other, middle, high)
    return np.asarray(origin + high[..., None] * direction)


def _grid(rows: int, columns: int, first: int = 0) -> NDArray[np.int64]:
    """Faces of a grid that is closed along its columns."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    a, b = first + i * columns + j, first + i * columns + (j + 1) % columns
    c, d = a + columns, b + columns
    return np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])


def shell(rows: int = 132, columns: int = 92) -> Part:
    """Body, closed."""
    # ---- Along the car: dense at the edges of the arches, and at nose and tail, where rays fan out ----
    s = np.linspace(-1, 1, 4001)
    ends = np.array(_AXIS_ENDS)
    along = np.interp(s, [-0.72, 0.72], ends)
    density = 1 + sum(0.9 * np.exp(-(((along - w - e) / 0.11) ** 2)) for w in WHEELS for e in (-0.36, 0.36))
    density = density + 0.9 * np.exp(-(((np.abs(s) - 0.86) / 0.09) ** 2))
    place = np.interp(np.linspace(0, 1, rows + 2)[1:-1], np.cumsum(density) / density.sum(), s)
    fan = np.clip((np.abs(place) - 0.72) / 0.28, 0, 1) * np.pi / 2 * np.sign(place)
    origin = np.stack([np.interp(place, [-0.72, 0.72], ends), np.full(rows, _AXIS_HEIGHT), np.zeros(rows)], -1)
    # ---- Around: by arc length, about equal for neighbouring rows ----
    fine = np.linspace(0, 2 * np.pi, 721)[:-1]
    around = _met(*_rays(origin, fan, np.tile(fine, (rows, 1))), 0.0, 1.6, 80)
    step = np.linalg.norm(np.roll(around, -1, axis=1) - around, axis=-1)
    share = step / step.sum(axis=1, keepdims=True)
    kernel = np.exp(-((np.arange(-12, 13) / 6.0) ** 2))
    share = np.apply_along_axis(lambda c: np.convolve(np.pad(c, 12, "edge"), kernel / kernel.sum(), "valid"), 0, share)
    share = 0.5 * (share + share[:, ::-1]) + 0.25 / 720  # left as right
    whole = np.concatenate([np.zeros((rows, 1)), np.cumsum(share, axis=1)], axis=1)
    wanted = np.arange(columns) / columns
    angle = np.stack([np.interp(wanted, row / row[-1], np.append(fine, 2 * np.pi)) for row in whole])
    grid = _met(*_rays(origin, fan, angle), 0.0, 1.6)
    tips = _met(np.array([[e, _AXIS_HEIGHT, 0] for e in ends]), np.array([[-1.0, 0, 0], [1.0, 0, 0]]), 0.0, 1.6)
    vertices = np.concatenate([grid.reshape(-1, 3), tips])
    lateral = _grid(rows, columns)
    vertices, normals = _with_arches(vertices, lateral)
    ring, last = np.arange(columns), rows * columns
    caps = [np.stack([np.roll(ring, -1), ring, np.full(columns, last)], -1)]
    top = ring + last - columns
    caps.append(np.stack([top, np.roll(top, -1), np.full(columns, last + 1)], -1))
    return vertices, normals, _outward(vertices, np.concatenate([lateral, *caps]))


def _with_arches(vertices: Points, faces: NDArray[np.int64]) -> tuple[Points, Points]:
    """Vertices and normals with wheel arches: vertices near an arch are moved to its edge, those within it inward."""
    vertices = vertices.copy()
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    outer, deep = np.abs(vertices[:, 2]) > 0.52, []
    for centre in WHEELS:
        hub = np.array([centre, AXLE_HEIGHT])
        beyond = np.hypot(*(vertices[:, :2] - hub).T) - ARCH_RADIUS
        beyond[~outer] = 1.0
        crossing = edges[(beyond[edges[:, 0]] < 0) != (beyond[edges[:, 1]] < 0)]
        crossing = crossing[outer[crossing].all(axis=1)]
        nearer = np.argmin(np.abs(beyond[crossing]), axis=1)
        snapped = np.unique(crossing[np.arange(len(crossing)), nearer])
        spoke = vertices[snapped, :2] - hub
        place = hub + ARCH_RADIUS * spoke / np.linalg.norm(spoke, axis=1, keepdims=True)
        side = np.sign(vertices[snapped, 2:])
        seen = _met(np.hstack([place, 1.2 * side]), np.hstack([0 * place, -side]), 0.0, 1.2)
        fits = np.abs(seen[:, 2]) > 0.52  # below the sill there is no edge
        vertices[snapped[fits]] = seen[fits]
        within = beyond < 0
        within[snapped[fits]] = False
        deep.append(np.flatnonzero(within))
    normals = _normals(vertices)
    for inside in deep:
        side = np.sign(vertices[inside, 2])
        vertices[inside, 2] = 0.5 * side
        normals[inside] = side[:, None] * [0, 0, 1]
    return vertices, normals


def _rays(origin: Points, fan: Points, angle: Points) -> tuple[Points, Points]:
    flat, turn = np.cos(fan)[:, None], np.sin(fan)[:, None]
    direction = np.stack([turn + 0 * angle, -flat * np.cos(angle), flat * np.sin(angle)], -1)
    return np.broadcast_to(origin[:, None], direction.shape), direction


def _outward(vertices: Points, faces: NDArray[np.int64]) -> NDArray[np.int64]:
    a, b, c = (vertices[faces[:, k]] - vertices.mean(axis=0) for k in range(3))
    return faces if (a * np.cross(b, c)).sum() > 0 else faces[:, ::-1]


def patch(outline: Points, toward: Points, height: float = 0.004, rings: int = 9, cuts: int = 3) -> Part:
    """Patch on the body.

    Its outline, corners (N, 3) cut `cuts` times, is projected along `toward`, and filled by rings.
    """
    for _ in range(cuts):  # Chaikin's
        after = np.roll(outline, -1, axis=0)
        outline = np.stack([0.8 * outline + 0.2 * after, 0.2 * outline + 0.8 * after], axis=1).reshape(-1, 3)
    direction = np.asarray(toward, float) / np.linalg.norm(toward)
    centre = outline.mean(axis=0)
    radii = np.append(np.linspace(0.06, 1, rings), 1.02)
    points = centre + radii[:, None, None] * (outline - centre)
    surface = _met(points - 1.2 * direction, np.broadcast_to(direction, points.shape), 0.0, 2.2, 220)
    normals = _normals(surface)
    lift = np.append(np.full(rings, height), -0.01)  # the last ring closes the edge
    surface = surface + lift[:, None, None] * normals
    rows, columns = surface.shape[:2]
    vertices = np.concatenate([surface.reshape(-1, 3), surface[0].mean(axis=0, keepdims=True)])
    hub = np.arange(columns)
    faces = np.concatenate(
        [_grid(rows, columns), np.stack([np.roll(hub, -1), hub, np.full(columns, rows * columns)], -1)]
    )
    n = np.concatenate([normals.reshape(-1, 3), normals[0].mean(axis=0, keepdims=True)])
    n[-1] /= np.linalg.norm(n[-1])
    across = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    if (across * n[faces[:, 0]]).sum() < 0:
        faces = faces[:, ::-1]
    return vertices, n, faces


def ribbon(line: Points, toward: Points, width: float, height: float = 0.002) -> Part:
    """Strip of the body along a line of points (N, 3) projected along `toward`."""
    direction = np.asarray(toward, float) / np.linalg.norm(toward)
    middle = _met(line - 1.2 * direction, np.broadcast_to(direction, line.shape), 0.0, 2.2, 220)
    n = _normals(middle)
    across = np.cross(n, np.gradient(middle, axis=0))
    across *= 0.5 * width / np.linalg.norm(across, axis=1, keepdims=True)
    vertices = np.concatenate([middle + across + height * n, middle - across + height * n])
    i, count = np.arange(len(line) - 1), len(line)
    faces = np.concatenate([np.stack([i, i + count, i + 1], -1), np.stack([i + 1, i + count, i + count + 1], -1)])
    e = np.cross(vertices[faces[0, 1]] - vertices[faces[0, 0]], vertices[faces[0, 2]] - vertices[faces[0, 0]])
    return vertices, np.concatenate([n, n]), faces if e @ n[0] > 0 else faces[:, ::-1]


def _lathe(profile: Points, count: int) -> Part:
    """Closed profile (N, 2) of radius and z, turned about the z axis."""
    angle = 2 * np.pi * np.arange(count) / count
    rim = np.concatenate([profile, profile[:1]])
    tangent = np.roll(profile, -1, axis=0) - np.roll(profile, 1, axis=0)
    tangent = np.concatenate([tangent, tangent[:1]])
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], -1)
    area = (profile[:, 0] * np.roll(profile[:, 1], -1) - profile[:, 1] * np.roll(profile[:, 0], -1)).sum()
    normal *= np.sign(area) / np.linalg.norm(normal, axis=1, keepdims=True)
    c, s = np.cos(angle), np.sin(angle)

    def turned(rz: Points) -> Points:
        return np.stack([rz[:, :1] * c, rz[:, :1] * s, rz[:, 1:] + 0 * c], -1).reshape(-1, 3)

    vertices = turned(rim)
    return vertices, turned(normal), _outward(vertices, _grid(len(rim), count))


def _ellipsoid(centre: Points, axes: Points, power: float = 2.0, rows: int = 14, columns: int = 24) -> Part:
    """Superellipsoid; power 2 is an ellipsoid, a larger one a rounded box. `axes` has its half axes as rows."""
    polar = np.pi * (np.arange(rows) + 0.5) / rows
    angle = 2 * np.pi * np.arange(columns) / columns
    d = np.stack(np.broadcast_arrays(np.sin(polar)[:, None] * np.cos(angle), np.cos(polar)[:, None] + 0 * angle,
                                     np.sin(polar)[:, None] * np.sin(angle)), -1)  # fmt: skip
    d = np.concatenate([d.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])
    local = d / (np.abs(d) ** power).sum(axis=1, keepdims=True) ** (1 / power)
    n = np.sign(local) * np.abs(local) ** (power - 1) @ np.linalg.inv(axes).T
    ring, last = np.arange(columns), rows * columns
    caps = [np.stack([np.roll(ring, -1), ring, np.full(columns, last)], -1)]
    bottom = ring + last - columns
    caps.append(np.stack([bottom, np.roll(bottom, -1), np.full(columns, last + 1)], -1))
    vertices = centre + local @ axes
    faces = np.concatenate([_grid(rows, columns), *caps])
    return vertices, n / np.linalg.norm(n, axis=1, keepdims=True), _outward(vertices, faces)


def _moved(part: Part, offset: tuple[float, float, float], flip: bool = False) -> Part:
    vertices, normals, faces = part
    if flip:
        mirror = np.array([1.0, 1.0, -1.0])
        vertices, normals, faces = vertices * mirror, normals * mirror, faces[:, ::-1]
    return vertices + np.array(offset), normals, faces


def _both(part: Part) -> list[Part]:
    return [part, _moved(part, (0, 0, 0), flip=True)]


def joined(parts: list[Part]) -> Part:
    """One part of several."""
    first = np.cumsum([0, *(len(v) for v, _, _ in parts[:-1])])
    faces = np.concatenate([f + k for (_, _, f), k in zip(parts, first, strict=True)])
    return np.concatenate([v for v, _, _ in parts]), np.concatenate([n for _, n, _ in parts]), faces


def _side(*corners: tuple[float, float]) -> Points:
    return np.array([(x, y, 0.0) for x, y in corners])


def _front(x: float, *corners: tuple[float, float]) -> Points:
    return np.array([(x, y, z) for z, y in corners])


def _rounded(corners: Points, cuts: int = 2) -> Points:
    for _ in range(cuts):
        after = np.roll(corners, -1, axis=0)
        corners = np.stack([0.75 * corners + 0.25 * after, 0.25 * corners + 0.75 * after], axis=1).reshape(-1, 2)
    return corners


def glass() -> Part:
    """Windows and lamps."""
    inward = np.array([0, 0, -1.0])
    door = _side((0.80, 0.965), (0.37, 1.20), (0.12, 1.265), (-0.20, 1.275), (-0.20, 0.965))
    rear = _side((-0.28, 0.965), (-0.28, 1.275), (-0.62, 1.25), (-1.00, 1.13), (-1.32, 0.99), (-1.25, 0.97))
    parts = [*_both(patch(door, inward)), *_both(patch(rear, inward))]
    screen = _front(0.7, (0.63, 0.955), (0.50, 1.27), (0.0, 1.30), (-0.50, 1.27), (-0.63, 0.955), (0.0, 0.935))
    parts.append(patch(screen, np.array([-1, -0.25, 0]), rings=12))
    back = _front(-1.4, (0.55, 1.03), (0.47, 1.24), (0.0, 1.26), (-0.47, 1.24), (-0.55, 1.03), (0.0, 1.02))
    parts.append(patch(back, np.array([1, -0.35, 0]), rings=12))
    lamp = _front(2.0, (0.36, 0.585), (0.42, 0.645), (0.77, 0.72), (0.76, 0.62), (0.60, 0.57))
    tail = _front(-2.0, (0.36, 0.80), (0.37, 0.87), (0.74, 0.87), (0.73, 0.79))
    parts += [*_both(patch(lamp, np.array([-1.0, 0, -0.25]))), *_both(patch(tail, np.array([1.0, 0, -0.1])))]
    return joined(parts)


def rubber() -> Part:
    """Tyres, linings of the arches, grille, bumper and gaps."""
    r, half = WHEEL_RADIUS, 0.105
    tread = [(r - 0.002, -half + 0.035), (r, 0.0), (r - 0.002, half - 0.035), (r - 0.03, half), (0.262, half - 0.012),
             (0.235, half - 0.03), (0.235, -half + 0.03), (0.262, -half + 0.012), (r - 0.03, -half)]  # fmt: skip
    tyre = _lathe(_rounded(np.array(tread), 1), 44)
    lining = _lathe(
        np.array([(0.02, -0.2), (0.38, -0.2), (0.38, 0.09), (0.36, 0.08), (0.36, -0.17), (0.02, -0.17)]), 40
    )
    vertices, normals, faces = lining
    lining = vertices, normals, faces[(vertices[faces, 1] > -0.16).all(axis=1)]  # above the sill
    parts, brake = [], _lathe(np.array([(0.01, 0.02), (0.225, 0.02), (0.225, -0.02), (0.01, -0.02)]), 24)
    for x in WHEELS:
        parts += _both(_moved(brake, (x, AXLE_HEIGHT, TRACK)))
        parts += [*_both(_moved(tyre, (x, AXLE_HEIGHT, TRACK))), *_both(_moved(lining, (x, AXLE_HEIGHT, TRACK)))]
    grille = _front(2.0, (0.46, 0.335), (0.40, 0.465), (-0.40, 0.465), (-0.46, 0.335))
    parts.append(patch(grille, np.array([-1.0, 0, 0])))
    plate = _front(-2.0, (0.60, 0.36), (0.60, 0.46), (-0.60, 0.46), (-0.60, 0.36))
    parts.append(patch(plate, np.array([1.0, 0, 0])))
    t = np.linspace(0, 1, 24)
    inward = np.array([0, 0, -1.0])
    for x, lean in ((0.86, 0.10), (-0.245, 0.0), (-0.93, -0.22)):
        line = np.stack([x + lean * (1 - t) ** 2 * np.sign(-x) * -1, 0.30 + 0.62 * t, 0 * t], -1)
        parts += _both(ribbon(line, inward, 0.008))
    line = np.stack([0.86 - 1.72 * t, 0.295 + 0 * t, 0 * t], -1)
    parts += _both(ribbon(line, inward, 0.010))
    seam = np.stack([1.95 - 0.95 * t, 0 * t + 1.2, 0.70 - 0.06 * t], -1)
    return joined([*parts, *_both(ribbon(seam, np.array([0, -1.0, 0]), 0.007))])


def metal() -> Part:
    """Rims, handles and trim."""
    dish = [(0.262, 0.078), (0.270, 0.088), (0.262, 0.096), (0.246, 0.088), (0.236, 0.02), (0.236, -0.07),
            (0.252, -0.075), (0.25, 0.02)]  # fmt: skip
    rim = [_lathe(_rounded(np.array(dish), 1), 36)]
    for k in range(10):
        a = 2 * np.pi * (k // 2) / 5 + np.pi / 2 + (0.16 if k % 2 else -0.16)
        out, across = np.array([np.cos(a), np.sin(a), -0.02]), np.array([-np.sin(a), np.cos(a), 0])
        axes = np.stack([0.112 * out, 0.018 * across, np.array([0, 0, 0.016])])
        rim.append(_ellipsoid(0.140 * out + np.array([0, 0, 0.068]), axes, 4.0, 7, 10))
    rim.append(_ellipsoid(np.array([0, 0, 0.066]), np.diag([0.062, 0.062, 0.024]), 2.6, 7, 16))
    wheel = joined(rim)
    parts = [p for x in WHEELS for p in _both(_moved(wheel, (x, AXLE_HEIGHT, TRACK)))]
    t = np.linspace(0, 1, 40)
    belt = np.stack([0.83 - 2.16 * t, 0.952 + 0.016 * t**3, 0 * t], -1)
    parts += _both(ribbon(belt, np.array([0, 0, -1.0]), 0.016, 0.005))
    for x in (-0.13, -0.84):
        parts += _both(_ellipsoid(np.array([x, 0.815, 0.875]), np.diag([0.085, 0.013, 0.022]), 3.0, 9, 16))
    return joined(parts)


def mirrors() -> list[Part]:
    """Mirror housings, painted."""
    axes = np.array([[0.075, 0, 0.015], [0, 0.062, 0], [-0.02, 0.0, 0.105]])
    return _both(_ellipsoid(np.array([0.66, 1.0, 0.875]), axes, 2.6))


def write_ply(path: Path, part: Part) -> None:
    """Write a mesh as binary PLY with vertex normals."""
    vertices, normals, faces = part
    header = "ply\nformat binary_little_endian 1.0\ncomment made by make_car.py\n"
    header += f"element vertex {len(vertices)}\n" + "".join(
        f"property float {c}\n" for c in ("x", "y", "z", "nx", "ny", "nz")
    )
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.empty(len(faces), [("count", "u1"), ("index", "<i4", 3)])
    rows["count"], rows["index"] = 3, faces
    data = np.concatenate([vertices, normals], axis=1).astype("<f4")
    path.write_bytes(header.encode() + data.tobytes() + rows.tobytes())


def main(folder: Path) -> None:
    """Write all parts."""
    parts = {"body": joined([shell(), *mirrors()]), "rubber": rubber(), "metal": metal(), "glass": glass()}
    for name, part in parts.items():
        write_ply(folder / f"car-{name}.ply", part)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
