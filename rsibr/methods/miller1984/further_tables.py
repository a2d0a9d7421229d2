"""Further tables of Miller & Hoffman (1984), section 9: backscatter by the viewing direction, refraction."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from rsibr.methods.inputs import MethodInputs
from rsibr.methods.miller1984.illumination import illumination_table
from rsibr.methods.miller1984.miller1984 import (
    Miller1984,
    checked_exponent,
    checked_sizes,
    miller1984,
)
from rsibr.methods.miller1984.polar_table import Lookup, PolarTable
from rsibr.methods.miller1984.reflectance import phong
from rsibr.methods.miller1984.tables import ILLUMINATION_ROWS, phong_rows, specular_map
from rsibr.methods.options import Colour, colour, number
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.shading_method import POINTS, Shading, ShadingMethod


@dataclass(eq=False)
class Backscatter:
    """Shading of a surface plus a specular table that is indexed by the viewing direction, S_b[E].

    Attributes
    ----------
    surface : Shading
        Diffuse and specular part.
    table : PolarTable
        Table S_b.
    """

    surface: Shading
    table: PolarTable

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        return self.surface.radiance(n, v) + self.table.fetch(v)


@register(
    "miller1984-backscatter",
    summary="miller1984 with a third map by the viewing direction: lunar dust, reflective signs",
    needs=Needs(light=True, lobes=True),
    sees_delta_lights=True,
    listed=False,
)
def backscatter(
    inputs: MethodInputs,
    *,
    albedo: Colour = 0.2,
    n_b: float = 20.0,
    illumination_rows: int = ILLUMINATION_ROWS,
    lookup: Lookup = "bilinear",
    points: int = POINTS,
) -> Miller1984:
    """Make the method.

    Parameters
    ----------
    inputs : MethodInputs
        Light and lobes of a bake. Lobes that reflect back to the viewer are not among those of a bake, so that the
        backscatter is the user's.
    albedo : float or three floats
        Light of a constant sky that is reflected back: k_s = 2(n + 1) · albedo.
    n_b : float
        Exponent of the Phong function around the viewing direction.
    illumination_rows, lookup, points
        Of `miller1984`; its other options keep their defaults.
    """
    method = miller1984(inputs, illumination_rows=illumination_rows, lookup=lookup, points=points)
    checked_exponent("n_b", n_b, illumination_rows)
    light, rows = illumination_table(inputs.light, illumination_rows), phong_rows(n_b, illumination_rows)
    table = specular_map(light, 2 * (n_b + 1) * colour("albedo", albedo), phong(n_b), rows, rows)
    shading = Backscatter(method.shading, PolarTable.of(table, lookup))
    return Miller1984(inputs, shading, method.points, method.material, method.fit)


@dataclass(eq=False)
class Refraction:
    """Interface of a clear medium: F(E·N) I[R] + (1 − F(E·N)) k I[T], with T the refracted direction.

    A single surface, as in the paper: what is seen in the direction T inside the medium is the environment itself.

    Attributes
    ----------
    illumination : PolarTable
        Illumination table, the map of a mirror.
    ior : mi.Float
        Index of refraction η inside over outside.
    transmitted : mi.Color3f
        Constant k.
    """

    illumination: PolarTable
    ior: mi.Float
    transmitted: mi.Color3f

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        cosine = dr.clip(dr.dot(n, v), 0, 1)
        reflected, _, _, _ = mi.fresnel(cosine, self.ior)
        mirrored = self.illumination.fetch(2 * cosine * n - v)
        through = self.illumination.fetch(refracted_direction(n, v, self.ior))
        return reflected * mirrored + (1 - reflected) * self.transmitted * through


def refracted_direction(n: mi.Vector3f, v: mi.Vector3f, ior: mi.Float) -> mi.Vector3f:
    """Direction in which the eye's ray goes on below the surface, by Snell's law; total reflection is clamped.

    Parameters
    ----------
    n, v : mi.Vector3f
        Unit normals, and unit directions to the viewer, n·v ≥ 0.
    ior : mi.Float
        Index of refraction η below over above the surface.
    """
    cosine, inverse = dr.dot(n, v), dr.rcp(ior)
    below = dr.safe_sqrt(1 - inverse * inverse * (1 - cosine * cosine))
    return dr.normalize((inverse * cosine - below) * n - inverse * v)


@register(
    "miller1984-refraction",
    summary="Miller & Hoffman (1984), section 9: refraction at a single surface by a mirror map",
    needs=Needs(light=True),
    sees_delta_lights=True,
    listed=False,
)
def refraction(
    inputs: MethodInputs,
    *,
    ior: float = 1.5,
    k: Colour = 1.0,
    lookup: Lookup = "bilinear",
    illumination_rows: int = ILLUMINATION_ROWS,
    points: int = POINTS,
) -> ShadingMethod:
    """Make the method, which replaces the material of the bake.

    Parameters
    ----------
    inputs : MethodInputs
        Light of a bake.
    ior : float
        Index of refraction of the medium over that outside, > 0; with 1 the environment is seen through.
    k : float or three floats
        Share of the transmitted light, its colour.
    lookup, illumination_rows, points
        As of `miller1984`.
    """
    number("ior", ior, above=0.01, most=100.0)
    checked_sizes(lookup, points, illumination_rows)
    table = PolarTable.of(illumination_table(inputs.light, illumination_rows), lookup)
    transmitted = mi.Color3f(colour("k", k).tolist())
    dr.make_opaque(transmitted)
    return ShadingMethod(inputs, Refraction(table, dr.opaque(mi.Float, ior), transmitted), points)
