"""What a bake predicts of its matte part and of its gloss: enough to darken each by what the object hides of it."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.light.radiance import Light
from rsibr.lobes.albedo import over_disk
from rsibr.lobes.facet_moments import cosines
from rsibr.methods.cosine_table import CosineTable
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.lobe_terms import LobeTerms, albedo_at_nodes
from rsibr.methods.rsibr.matte_light import MatteLight

Array = NDArray[np.float64]


@dataclass(eq=False)
class MaterialParts:
    """Matte part and gloss of one bake.

    Attributes
    ----------
    matte : list of MatteLight
        Matte parts of the lobes; empty for a metal.
    gloss : CosineTable
        Directional albedo of all that is not matte, by cos θ.
    matte_albedo, gloss_albedo : ndarray, shape (3,)
        Hemispherical albedos.
    delta : tuple of (mi.Vector3f, mi.Color3f)
        Lights without extent, which no irradiance map holds: direction, and irradiance over π.
    """

    matte: list[MatteLight]
    gloss: CosineTable
    matte_albedo: Array
    gloss_albedo: Array
    delta: tuple[tuple[mi.Vector3f, mi.Color3f], ...]

    @classmethod
    def of(cls, inputs: MethodInputs) -> MaterialParts:
        """Parts of a bake; one without lobes or light has none."""
        if not inputs.lobes or inputs.bake.manifest.light is None:
            none = np.zeros((2, 3))
            return cls([], CosineTable.of(none), none[0], none[0], ())
        light, lobes = inputs.light, list(inputs.shapes.values())
        terms = LobeTerms.of(lobes).matte
        flat = sum((term.share for term in terms), start=np.zeros((len(cosines()), 3)))
        whole = sum((albedo_at_nodes(albedo) for _, albedo in lobes), start=np.zeros_like(flat))
        shiny = np.maximum(whole - flat, 0)
        return cls(MatteLight.of(terms, light), CosineTable.of(shiny), _mean(flat), _mean(shiny), _delta(light))

    @property
    def is_metal(self) -> bool:
        """Whether nothing is matte: then what a mirror ray meets is bright, and a black ray worse than none."""
        return not self.matte

    def matte_radiance(self, n: mi.Vector3f, cosine: mi.Float) -> mi.Color3f:
        """Radiance of the matte part under the open sky, at world normals seen under cos θ."""
        lit = mi.Color3f(0)
        for direction, power in self.delta:
            lit += power * dr.maximum(dr.dot(n, direction), 0)
        total = mi.Color3f(0)
        for part in self.matte:
            total += part.radiance(n, cosine)
            if self.delta:
                total += part.share.colour(cosine) * lit
        return total


def _mean(albedo: Array) -> Array:
    """Hemispherical albedo 2 ∫ E(μ) μ dμ of a table over `cosines`."""
    return over_disk(albedo, cosines())


def _delta(light: Light) -> tuple[tuple[mi.Vector3f, mi.Color3f], ...]:
    found = []
    for direction, power in zip(light.delta.directions, light.delta.irradiance / np.pi, strict=True):
        one = mi.Vector3f(*map(float, direction)), mi.Color3f(*map(float, power))
        dr.make_opaque(one)
        found.append(one)
    return tuple(found)
