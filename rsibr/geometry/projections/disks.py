"""Projections onto disks around an axis: orthographic and paraboloid pairs, mirror ball, angular map, sphere map.

Each has a law that gives the angle θ from the axis at the radius r of the disk; the azimuth stays. The solid angle
within r and an azimuth dφ is (1 − cos θ(r)) dφ, so that one contour integral serves them all.
"""

from __future__ import annotations

from abc import abstractmethod

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.projections.bordered_texels import BorderedTexels
from rsibr.geometry.projections.projection import Place, Projection, register
from rsibr.geometry.projections.sphere_map import disk_from_normal, disk_from_reflection
from rsibr.geometry.projections.texel_axis import TexelAxis

_NODES = 24  # of the quadrature along a line of texel corners


class Disks(Projection):
    """One or two disks of radius 1 in square sheets, x right and y up: p_x = (1+x)/2, p_y = (1−y)/2.

    +Z is in the middle of the first sheet, −Z in that of the second, which shows (x, y, −z) where the first shows
    (x, y, z). Outside its disk a sheet goes on behind the rim: on the other sheet, or, if it is alone, on the side
    opposite.
    """

    share = np.pi / 4

    @abstractmethod
    def cosine(self, r2: mi.Float) -> mi.Float:
        """Cosine of θ at a squared radius in [0, 1]."""

    @abstractmethod
    def stretch(self, r2: mi.Float) -> mi.Float:
        """Ratio sin θ / r at a squared radius in [0, 1]."""

    @abstractmethod
    def disk(self, d: mi.Vector3f) -> mi.Point2f:
        """Point (x, y) of a direction; with z ≥ 0 if there are two disks."""

    @abstractmethod
    def area_law(self, r2: mi.Float) -> mi.Float:
        """Solid angle [sr] per unit of area of the disk at a squared radius in [0, 1]: −2 d cos θ / d r²."""

    def behind(self, r: mi.Float) -> mi.Float:
        """Radius at which the disk behind the rim shows what lies at r > 1 of this one."""
        return dr.maximum(2 - r, 0)

    def direction(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Vector3f:  # noqa: D102
        x, y = 2 * p.x - 1, 1 - 2 * p.y
        r = dr.sqrt(x * x + y * y)
        is_out = r > 1
        inner = dr.select(is_out, self.behind(r), r)
        side = -1 if self.sheets == 1 and self.covers_sphere else 1
        shrink = dr.select(is_out, side * inner / r, 1)
        stretch, r2 = self.stretch(inner * inner), inner * inner
        back = (sheet == 1) ^ (is_out & (self.sheets == 2))
        z = self.cosine(r2)
        return dr.normalize(mi.Vector3f(x * shrink * stretch, y * shrink * stretch, dr.select(back, -z, z)))

    def place(self, d: mi.Vector3f) -> Place:  # noqa: D102
        back = (d.z < 0) & (self.sheets == 2)
        z = dr.select(back, -d.z, d.z)
        q = self.disk(mi.Vector3f(d.x, d.y, z))
        # −Z, which is the whole rim of a ball: rounding must not throw it into the middle
        q = dr.select((z < 0) & (dr.squared_norm(q) < 0.2), mi.Point2f(1, 0), q)
        return dr.select(back, mi.UInt32(1), mi.UInt32(0)), mi.Point2f(0.5 + 0.5 * q.x, 0.5 - 0.5 * q.y)

    def density(self, sheet: mi.UInt32, p: mi.Point2f) -> mi.Float:  # noqa: D102, ARG002
        r2 = dr.square(2 * p.x - 1) + dr.square(1 - 2 * p.y)
        return dr.select(r2 < 1, 4 * self.area_law(dr.minimum(r2, 1)), 0)

    def solid_angles(self, columns: TexelAxis, rows: TexelAxis) -> NDArray[np.float64]:  # noqa: D102
        x, y = np.meshgrid(2 * columns.edges() - 1, 1 - 2 * rows.edges())
        corner = np.sign(x) * np.sign(y) * (self._along(np.abs(x), np.abs(y)) + self._along(np.abs(y), np.abs(x)))
        area = corner[:-1, 1:] - corner[1:, 1:] - corner[:-1, :-1] + corner[1:, :-1]
        return np.repeat(np.maximum(area, 0)[None], self.sheets, axis=0)

    def _along(self, h: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Contour integral ∫ (1 − cos θ) dφ along the line at distance h from the middle, from its foot to t.

        Inside the disk dφ = h dy / r², outside the integrand is constant. Nodes are dense at the far end, where cos θ
        may have a square root.
        """
        inside = np.minimum(t, np.sqrt(np.maximum(1 - h * h, 0)))
        within = np.zeros_like(inside)
        for node, weight in zip(*np.polynomial.legendre.leggauss(_NODES), strict=True):
            s = 0.5 + 0.5 * node
            r2 = np.clip(h * h + (inside * s * (2 - s)) ** 2, 1e-300, 1)
            within += (1 - s) * weight * self._cap(r2) / r2
        whole = float(self._cap(np.ones(1))[0])
        return np.asarray(h * inside * within + whole * (np.arctan2(t, h) - np.arctan2(inside, h)))

    def _cap(self, r2: NDArray[np.float64]) -> NDArray[np.float64]:
        """1 − cos θ at a squared radius."""
        return 1 - np.array(self.cosine(mi.Float64(r2.ravel()))).reshape(r2.shape)

    def bordered(self, values: NDArray[np.float32]) -> NDArray[np.float32]:  # noqa: D102
        columns, rows = self.axes(values.shape[1:3])
        x, y = np.meshgrid(2 * columns.centres() - 1, 1 - 2 * rows.centres())
        own = x * x + y * y <= 1
        # Interpolate between the texels with their centre inside: their presence is the fourth channel
        present = np.repeat(own[None, ..., None], len(values), axis=0).astype(np.float32)
        known = np.concatenate([values * present, present], axis=3)
        framed = np.pad(known, ((0, 0), (1, 1), (1, 1), (0, 0)))
        missing = framed[..., 3] == 0
        sheet, row, column = np.nonzero(missing)
        p = mi.Point2f(
            columns.place(mi.Float((column - 1).astype(np.float32))), rows.place(mi.Float((row - 1).astype(np.float32)))
        )
        d = self.direction(mi.UInt32(sheet.astype(np.uint32)), p)
        found = np.array(BorderedTexels.of(framed, columns, rows).lookup(*self.place(d))).T
        framed[missing, :3] = found[:, :3] / np.maximum(found[:, 3:], 1e-6)
        return np.ascontiguousarray(framed[..., :3])


class Orthographic(Disks):
    """Orthographic projection: sin θ = r. Miller & Hoffman (1984), section 4.2."""

    def __init__(self, name: str, sheets: int) -> None:
        self.name, self.sheets = name, sheets
        self.covers_sphere = sheets == 2

    def cosine(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return dr.sqrt(dr.maximum(1 - r2, 0))

    def stretch(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return 1 + 0 * r2

    def disk(self, d: mi.Vector3f) -> mi.Point2f:  # noqa: D102
        return disk_from_normal(d)

    def area_law(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return dr.rsqrt(dr.maximum(1 - r2, 1e-12))

    def behind(self, r: mi.Float) -> mi.Float:
        """As in `Disks`; a single hemisphere ends at its rim."""
        return super().behind(r) if self.sheets == 2 else dr.minimum(r, 1)


class DualParaboloid(Disks):
    """Two paraboloids: tan θ/2 = r. Heidrich & Seidel (1998)."""

    name = "dual-paraboloid"
    sheets = 2

    def cosine(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return (1 - r2) / (1 + r2)

    def stretch(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return 2 / (1 + r2)

    def disk(self, d: mi.Vector3f) -> mi.Point2f:  # noqa: D102
        return mi.Point2f(d.x, d.y) / (1 + d.z)

    def area_law(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return 4 / dr.square(1 + r2)

    def behind(self, r: mi.Float) -> mi.Float:
        """As in `Disks`: inversion in the rim, which is this projection itself on the other side."""
        return dr.rcp(r)


class MirrorBall(Disks):
    """Orthographic photograph of a mirror ball, indexed by the reflection: sin θ/2 = r, so that all areas are equal.

    The camera is at +Z. `g_mirror` of `rsibr.geometry.projections.sphere_map`; Lambert's azimuthal equal-area map.
    """

    name = "mirror-ball"

    def cosine(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return 1 - 2 * r2

    def stretch(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return 2 * dr.sqrt(dr.maximum(1 - r2, 0))

    def disk(self, d: mi.Vector3f) -> mi.Point2f:  # noqa: D102
        return disk_from_reflection(d)

    def area_law(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return 4 + 0 * r2


class Angular(Disks):
    """Angular map, or light probe: θ = πr. Debevec (1998); +Z is in the middle, +x right, as in a mirror ball."""

    name = "angular"

    def cosine(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return dr.cos(dr.pi * dr.sqrt(r2))

    def stretch(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        r = dr.sqrt(dr.maximum(r2, 1e-12))
        return dr.sin(dr.pi * r) / r

    def disk(self, d: mi.Vector3f) -> mi.Point2f:  # noqa: D102
        lateral = dr.sqrt(d.x * d.x + d.y * d.y)
        r = dr.atan2(lateral, d.z) * dr.inv_pi
        return mi.Point2f(d.x, d.y) * (r / dr.maximum(lateral, 1e-12))

    def area_law(self, r2: mi.Float) -> mi.Float:  # noqa: D102
        return dr.pi * self.stretch(r2)


ORTHOGRAPHIC_PAIR = register(Orthographic("orthographic-pair", 2))
DUAL_PARABOLOID = register(DualParaboloid())
MIRROR_BALL = register(MirrorBall())
ANGULAR = register(Angular())
SPHERE_MAP = register(Orthographic("sphere-map", 1))
"""Map indexed by normals: the hemisphere z ≥ 0 alone, `g_normal` of `rsibr.geometry.projections.sphere_map`."""
