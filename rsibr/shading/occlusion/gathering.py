"""Irradiance at points of the surface by rays: under the open sky, past the object, and by way of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.baking.lattice import generator
from rsibr.geometry.to_device import to_device
from rsibr.shading.occlusion.point_field import PointField
from rsibr.shading.occlusion.sky import Sky

LANES = 2**18
"""Points of one kernel launch."""


@dataclass(eq=False)
class Places:
    """Points on the device, one a lane.

    Attributes
    ----------
    p : mi.Point3f
        Position, lifted off the surface.
    n : mi.Vector3f
        Unit normal.
    """

    p: mi.Point3f
    n: mi.Vector3f

    @classmethod
    def of(cls, positions: NDArray[np.float32], normals: NDArray[np.float32], lift: float) -> list[Places]:
        """Put points on the device, `LANES` at a time; `lift` is that of the scene."""
        parts = []
        for first in range(0, len(positions), LANES):
            rows = slice(first, first + LANES)
            n = normals[rows]
            p = positions[rows] + np.float32(lift) * n
            parts.append(cls(mi.Point3f(*_columns(p)), mi.Vector3f(*_columns(n))))
        return parts


@dataclass(frozen=True, eq=False)
class Irradiance:
    """Irradiance at points [W m⁻²].

    Attributes
    ----------
    open, past : ndarray, shape (N, 3)
        From the whole sky above the point, and from the part that the object does not hide.
    hidden : ndarray, shape (N,)
        Share of the rays that the object stops: cosine-weighted, whatever the sky.
    """

    open: NDArray[np.float64]
    past: NDArray[np.float64]
    hidden: NDArray[np.float64]


def gathered(scene: mi.Scene, places: list[Places], sky: Sky, rays: int) -> Irradiance:
    """Gather the irradiance of the sky at points.

    Parameters
    ----------
    scene : mi.Scene
        Shapes.
    places : list of Places
        Points.
    sky : Sky
        Environment.
    rays : int
        Cosine-weighted rays a point; one more to each source of the sky.

    Notes
    -----
    E = π ⟨L⟩ over cosine-weighted rays, plus Σ E_k n·d_k over the sources. Both sums share their rays, so that their
    ratio is 1 wherever nothing is hidden, whatever the noise.
    """
    found = [_gathered(scene, part, sky, rays, number) for number, part in enumerate(places)]
    columns = (np.concatenate([np.array(one[k], np.float64) for one in found], axis=-1) for k in range(3))
    bare, past, stopped = columns
    return Irradiance(bare.T, past.T, stopped / rays)


def _gathered(
    scene: mi.Scene, places: Places, sky: Sky, rays: int, number: int
) -> tuple[mi.Color3f, mi.Color3f, mi.Float]:
    lanes = dr.width(places.p)
    pattern = Pattern.of(rays, lanes, number)
    frame, count = mi.Frame3f(places.n), dr.opaque(mi.UInt32, rays)

    def even(k: mi.UInt32, bare: mi.Color3f, past: mi.Color3f, stopped: mi.Float) -> tuple[Any, ...]:
        d = frame.to_world(pattern.direction(k))
        hidden = scene.ray_test(mi.Ray3f(places.p, d))
        radiance = sky.even.fetch(d, mi.UInt32(0))
        return (
            k + 1,
            bare + radiance,
            past + dr.select(hidden, 0, radiance),
            stopped + dr.select(hidden, mi.Float(1), 0),
        )

    state = (mi.UInt32(0), dr.zeros(mi.Color3f, lanes), dr.zeros(mi.Color3f, lanes), dr.zeros(mi.Float, lanes))
    _, bare, past, stopped = dr.while_loop(state, lambda k, *_: k < count, even, label="cosine_rays")
    scale = dr.pi / mi.Float(count)

    def lit(k: mi.UInt32, bare: mi.Color3f, past: mi.Color3f) -> tuple[mi.UInt32, mi.Color3f, mi.Color3f]:
        d, power = sky.source(k)
        cosine = dr.dot(d, places.n)
        above = cosine > 0
        power = dr.select(above, power * cosine, 0)
        hidden = scene.ray_test(mi.Ray3f(places.p, d), active=above)
        return k + 1, bare + power, past + dr.select(hidden, 0, power)

    lit_so_far = (mi.UInt32(0), bare * scale, past * scale)
    _, bare, past = dr.while_loop(lit_so_far, lambda k, *_: k < sky.count, lit, label="source_rays")
    dr.eval(bare, past, stopped)
    return bare, past, stopped


def reflected(
    scene: mi.Scene, places: list[Places], exitant: PointField, rays: int, hidden: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Irradiance [W m⁻²] at points from the surfaces that they see, shape (N, 3).

    Parameters
    ----------
    scene, places, rays
        As in `gathered`.
    exitant : PointField
        Radiance that each surface reflects, the same in all directions [W sr⁻¹ m⁻²].
    hidden : ndarray, shape (N,)
        Share of the sky that these surfaces hide, from `gathered`: the mean over rays that meet one is scaled by it, so
        that what is hidden and what takes its place add up.
    """
    found = [_reflected(scene, part, exitant, rays, number) for number, part in enumerate(places)]
    return np.concatenate([np.zeros((0, 3)), *found]) * (np.pi * hidden[:, None])


def _reflected(scene: mi.Scene, places: Places, exitant: PointField, rays: int, number: int) -> NDArray[np.float64]:
    """Mean radiance over the rays that meet a surface."""
    lanes = dr.width(places.p)
    pattern, frame = Pattern.of(rays, lanes, number), mi.Frame3f(places.n)
    count = dr.opaque(mi.UInt32, rays)

    def add(k: mi.UInt32, hits: mi.UInt32, total: mi.Color3f) -> tuple[mi.UInt32, mi.UInt32, mi.Color3f]:
        ray = mi.Ray3f(places.p, frame.to_world(pattern.direction(k)))
        met = scene.ray_intersect_preliminary(ray)
        hits += dr.select(met.is_valid(), mi.UInt32(1), 0)
        return k + 1, hits, total + exitant.met(ray, met, mi.Bool(True))

    state = (mi.UInt32(0), dr.zeros(mi.UInt32, lanes), dr.zeros(mi.Color3f, lanes))
    _, hits, total = dr.while_loop(state, lambda k, *_: k < count, add, label="bounce_rays")
    dr.eval(hits, total)
    return np.asarray(np.array(total, np.float64).T / np.maximum(np.array(hits), 1)[:, None])


@dataclass(eq=False)
class Pattern:
    """Points of a rank-1 lattice on the cosine-weighted hemisphere, shifted at random for each lane.

    Attributes
    ----------
    across, down : mi.Float
        Steps of the lattice.
    shift : mi.Point2f
        Shift of each lane.
    """

    across: mi.Float
    down: mi.Float
    shift: mi.Point2f

    @classmethod
    def of(cls, rays: int, lanes: int, number: int) -> Pattern:
        """Make the pattern of so many rays; `number` tells launches of the same lanes apart."""
        random = mi.PCG32(lanes, initseq=dr.arange(mi.UInt64, lanes) + number * LANES)
        across, down = (dr.opaque(mi.Float, value / rays) for value in (1, generator(rays).texel[1]))
        shift = mi.Point2f(random.next_float32(), random.next_float32())
        dr.eval(shift)
        return cls(across, down, shift)

    def direction(self, k: mi.UInt32) -> mi.Vector3f:
        """Direction of ray k in the frame of the normal."""
        place = mi.Point2f(mi.Float(k) * self.across, mi.Float(k) * self.down) + self.shift
        return mi.warp.square_to_cosine_hemisphere(place - dr.floor(place))


def _columns(rows: NDArray[np.float32]) -> list[mi.Float]:
    return [to_device(mi.Float, column) for column in np.ascontiguousarray(rows.T)]


def ratio_of(light: Irradiance, bounced: NDArray[np.float64] | float = 0.0) -> NDArray[np.float32]:
    """Ratio of the irradiance that arrives to that under the open sky, shape (N, 3); 1 where there is none to hide."""
    arriving = light.past + bounced
    ratio = np.divide(
        arriving, light.open, out=np.ones_like(light.open), where=light.open > 1e-9 * light.open.max(initial=0)
    )
    return cast("NDArray[np.float32]", ratio.astype(np.float32))
