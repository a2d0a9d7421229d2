"""How much of the sky the shapes of a scene hide from each other, measured where pictures from all around see them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device
from rsibr.methods.inputs import MethodInputs
from rsibr.planning.model import SECOND_MOMENT
from rsibr.shading.occlusion.gathering import Places, gathered, ratio_of
from rsibr.shading.occlusion.material_parts import MaterialParts
from rsibr.shading.occlusion.sky import Sky
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import Surfaces, first_surfaces

Array = NDArray[np.float64]

VIEW_RAYS = 2**13
"""Parallel rays from all directions through the bounding sphere; those that meet a surface give the points."""

SKY_RAYS = 64
"""Cosine-weighted rays of each point."""

MOST_OF_A_POINT = 10.0
"""Most that a point counts in an estimated relMSE: a pixel averages over mirror rays, a point has one. Without it the
estimate for metals is tens of times what path tracing shows; with it, within a factor of seven on five meshes."""


@dataclass(frozen=True)
class TypeVisibility:
    """What is hidden from the surfaces of one type.

    Attributes
    ----------
    is_metal : bool
        Whether nothing of the material is matte.
    weight : float
        Share of the seen points that are of this type.
    matte_hidden : float
        Share of the irradiance that is hidden, mean over the points.
    sky_hidden : float
        Share of the sky that is hidden, cosine-weighted.
    mirror_hidden : float
        Share of the mirror directions that meet a surface.
    bounced : float
        Share of the arriving irradiance that comes by way of other surfaces, to first order.
    error_without, error_without_bounces : float
        Estimated relMSE of the open sky, and of hiding without what the hiding surfaces reflect.
    """

    is_metal: bool
    weight: float
    matte_hidden: float
    sky_hidden: float
    mirror_hidden: float
    bounced: float
    error_without: float
    error_without_bounces: float


def self_visibility(
    scene: ObjectScene, types: SurfaceTypes, inputs: Sequence[MethodInputs]
) -> tuple[TypeVisibility, ...]:
    """Measure each surface type; one that is never seen has a weight of 0.

    Notes
    -----
    Radiance is modelled: albedo times irradiance over π, plus albedo times the environment blurred by the gloss. What
    hides the sky is taken to reflect the mean of the arriving irradiance, and in mirror rays its own gloss.
    """
    seen = first_surfaces(scene.geometry, _rays(scene))
    kind = np.array(types.of(seen))
    dr.eval(seen)
    return tuple(_of_type(scene, seen, kind == index, one) for index, one in enumerate(inputs))


def _rays(scene: ObjectScene) -> mi.Ray3f:
    """Rays through the bounding sphere, uniform over directions and over its disk (R₄ sequence)."""
    index = np.arange(VIEW_RAYS)[:, None] + 0.5
    golden = 1.1673039782614187  # of the sequence in four dimensions: x⁵ = x + 1
    u = np.mod(index * golden ** -np.arange(1.0, 5.0), 1)
    z, turn = 1 - 2 * u[:, 0], 2 * np.pi * u[:, 1]
    d = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    across = np.cross(d, np.where(np.abs(d[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    radius, angle = scene.radius * np.sqrt(u[:, 2:3]), 2 * np.pi * u[:, 3:]
    offset = radius * (np.cos(angle) * across + np.sin(angle) * np.cross(d, across))
    origin = scene.centre + offset - 2 * scene.radius * d
    return mi.Ray3f(mi.Point3f(*_on_device(origin)), mi.Vector3f(*_on_device(d)))


def _of_type(scene: ObjectScene, seen: Surfaces, chosen: NDArray[np.bool_], inputs: MethodInputs) -> TypeVisibility:
    parts = MaterialParts.of(inputs)
    count = int(chosen.sum())
    if not count or inputs.bake.manifest.light is None:
        return TypeVisibility(parts.is_metal, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    # ---- What is hidden ----
    p, n, v, facing = (np.array(rows, np.float64).T[chosen] for rows in (seen.p, seen.n, seen.v, seen.facing))
    places = Places.of(_single(p), _single(n), scene.lift)
    light = gathered(scene.geometry, places, Sky.of(inputs.light), SKY_RAYS)
    mirror = 2 * n * (n * v).sum(axis=1, keepdims=True) - v
    above = (mirror * facing).sum(axis=1) > 0
    start = _lifted(scene, p, facing)
    behind = first_surfaces(scene.geometry, mi.Ray3f(start, mi.Vector3f(*_on_device(mirror))), mi.Bool(above))
    met = np.array(behind.hit) & above
    # ---- Radiance of both parts under the open sky, and past the object ----
    matte, gloss, shine = _modelled(inputs, parts, n, v)
    ratio = ratio_of(light).astype(np.float64)
    mean = light.past.mean(axis=0)
    bounced = light.hidden[:, None] * (parts.matte_albedo + parts.gloss_albedo) * mean
    with_bounces = ratio + bounced / np.maximum(light.open, 1e-12 * max(light.open.max(), 1e-30))
    shown = shine * (parts.matte_albedo * mean / math.pi + _second_gloss(inputs, parts, behind, met))
    true = with_bounces * matte + np.where(met[:, None], shown, gloss)
    shadowed = ratio * matte + np.where(met[:, None], 0, gloss)
    return TypeVisibility(
        is_metal=parts.is_metal,
        weight=count / max(int(np.array(seen.hit).sum()), 1),
        matte_hidden=float(1 - light.past.sum() / max(light.open.sum(), 1e-30)),
        sky_hidden=float(light.hidden.mean()),
        mirror_hidden=float(met.mean()),
        bounced=float(bounced.sum() / max((bounced + light.past).sum(), 1e-30)),
        error_without=_relative(matte + gloss, true),
        error_without_bounces=_relative(shadowed, true),
    )


def _modelled(inputs: MethodInputs, parts: MaterialParts, n: Array, v: Array) -> tuple[Array, Array, Array]:
    """Radiance of the matte part and of the gloss under the open sky, and the albedo of the gloss, (N, 3) each."""
    normal, viewer = mi.Vector3f(*_on_device(n)), mi.Vector3f(*_on_device(v))
    cosine = dr.dot(normal, viewer)
    albedo = parts.gloss.colour(cosine)
    around = inputs.pyramid.nearest_blurred(mi.reflect(viewer, normal), mi.Float(_gloss_width(inputs)))
    matte = mi.Color3f(parts.matte_radiance(normal, cosine)) + dr.zeros(mi.Color3f, len(n))
    matte_radiance, gloss, shine = (np.array(one, np.float64).T for one in (matte, albedo * around, albedo))
    return matte_radiance, gloss, shine


def _second_gloss(inputs: MethodInputs, parts: MaterialParts, behind: Surfaces, met: NDArray[np.bool_]) -> Array:
    """Gloss of the surfaces that mirror rays meet, as if of the same material under the open sky, (N, 3)."""
    n, v = (np.where(met[:, None], np.array(rows, np.float64).T, [0.0, 0.0, 1.0]) for rows in (behind.n, behind.v))
    return np.where(met[:, None], _modelled(inputs, parts, n, v)[1], 0)


def _gloss_width(inputs: MethodInputs) -> float:
    """Width [rad] of the lobes without a matte part around the mirror direction, by their albedo."""
    alphas = [(shape.alpha, float(table.mean())) for shape, table in inputs.shapes.values() if not shape.has_matte]
    total = sum(weight for _, weight in alphas)
    mean = sum(alpha * weight for alpha, weight in alphas) / total if total else 0.0
    return 2 * math.sqrt(SECOND_MOMENT) * mean


def _lifted(scene: ObjectScene, p: Array, facing: Array) -> mi.Point3f:
    return mi.Point3f(*_on_device(p + scene.lift * facing))


def _relative(estimate: Array, truth: Array) -> float:
    floor = (0.1 * truth.mean(axis=0)) ** 2 + 1e-30
    return float(np.minimum((estimate - truth) ** 2 / (truth**2 + floor), MOST_OF_A_POINT).mean())


def _single(rows: Array) -> NDArray[np.float32]:
    return rows.astype(np.float32)


def _on_device(rows: Array) -> list[Any]:
    return [to_device(mi.Float, column.astype(np.float32)) for column in np.ascontiguousarray(rows.T)]
