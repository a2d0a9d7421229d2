"""Occlusion of an object by itself, around any lookup: matte part by ratios at points, gloss by one mirror ray.

    L = ρ L_matte + (L_open − L_matte)                       where the mirror ray escapes
    L = ρ L_matte + E_gloss(cos θ) · L_met                   where it meets the object

with ρ the ratio of the arriving to the open irradiance, L_matte the prediction of the matte part, and L_met what the
surface reflects that the ray meets. Metals keep L_open: their gloss is all they have, and a black ray errs more than
none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.methods.inputs import MethodInputs
from rsibr.shading.lookups.registry import Shade
from rsibr.shading.occlusion.arriving import BOUNCES, RAYS, ArrivingLight
from rsibr.shading.occlusion.material_parts import MaterialParts
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shading.surfaces import Surfaces


@dataclass(eq=False)
class Occlusion:
    """What the shapes of a scene hide from each other.

    Attributes
    ----------
    geometry : mi.Scene
        Shapes.
    arriving : ArrivingLight
        Light at the vertices.
    parts : list of MaterialParts
        Matte part and gloss of each type.
    lift : mi.Float
        Distance from the surface at which mirror rays start (opaque).
    gloss : bool
        Whether mirror rays are traced.
    """

    geometry: mi.Scene
    arriving: ArrivingLight
    parts: list[MaterialParts]
    lift: mi.Float
    gloss: bool = True

    @classmethod
    def of(
        cls,
        scene: ObjectScene,
        types: SurfaceTypes,
        inputs: Sequence[MethodInputs],
        *,
        gloss: bool = True,
        bounces: int = BOUNCES,
        rays: int = RAYS,
    ) -> Occlusion:
        """Prepare the occlusion of a scene; parameters as of `ArrivingLight.of`."""
        arriving = ArrivingLight.of(scene, types, inputs, bounces=bounces, rays=rays)
        parts = [MaterialParts.of(one) for one in inputs]
        return cls(scene.geometry, arriving, parts, dr.opaque(mi.Float, scene.lift), gloss)

    def shading(self, shade: Shade, type: int) -> Shade:
        """Shading of one surface type past the other surfaces.

        Parameters
        ----------
        shade : callable
            Radiance under the open sky.
        type : int
            Index of the surface type.
        """
        parts = self.parts[type]
        if parts.is_metal:
            return shade

        def occluded(surfaces: Surfaces) -> mi.Color3f:
            # ---- Matte part, never more than the whole ----
            cosine, whole = dr.dot(surfaces.n, surfaces.v), shade(surfaces)
            matte = dr.clip(parts.matte_radiance(surfaces.n, cosine), 0, dr.maximum(whole, 0))
            ratio = self.arriving.ratio.on(surfaces, 1)
            gloss = whole - matte
            # ---- Gloss: what the mirror ray meets ----
            if self.gloss:
                gloss = self._past(surfaces, gloss, parts.gloss.colour(cosine))
            return dr.fma(ratio, matte, gloss)

        return occluded

    def _past(self, surfaces: Surfaces, gloss: mi.Color3f, albedo: mi.Color3f) -> mi.Color3f:
        """Gloss, or the reflection of the surface that the mirror ray meets.

        A mirror ray of an interpolated normal may point into the flat triangle: it meets the surface at its start.
        """
        d = mi.reflect(surfaces.v, surfaces.n)
        above = surfaces.hit & (dr.dot(d, surfaces.facing) > 0)
        start = surfaces.p + self.lift * surfaces.facing
        ray = mi.Ray3f(start, d)
        met = self.geometry.ray_intersect_preliminary(ray, active=above)
        other = dr.select(above, self.arriving.exitant.met(ray, met, above), self.arriving.exitant.on(surfaces, 0))
        return dr.select(surfaces.hit & (~above | met.is_valid()), albedo * other, gloss)
