"""Three-dimensional reflectance map of Miller & Hoffman (1984), section 9: by mirror direction R and view angle E·N.

Radiance toward a distant viewer under a distant light depends on four numbers: two of the normal and two of the view.
A table by R and E·N lacks one, the turn of the normal around R. It is complete for lobes that are symmetric about R at
each view angle, of any width and shape; of any other lobe it keeps the mean over that turn. `radiance_by_turn` shows
what is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.facet_moments import cosines
from rsibr.lobes.probe_directions import ProbeDirections
from rsibr.lobes.shape_fit import shape_values
from rsibr.methods.inputs import MethodInputs
from rsibr.methods.lobe_terms import Lobe, resampled
from rsibr.methods.miller1984.convolution import convolved, latitudes, texel_areas
from rsibr.methods.miller1984.illumination import illumination_table
from rsibr.methods.miller1984.material_fit import MaterialFit
from rsibr.methods.miller1984.miller1984 import Miller1984, checked_sizes, two_maps
from rsibr.methods.miller1984.polar_table import Lookup, PolarTable
from rsibr.methods.miller1984.reflectance import zonal
from rsibr.methods.miller1984.tables import DIFFUSE_ROWS, phong_rows
from rsibr.methods.miller1984.two_maps import TwoMaps
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.shading_method import POINTS

Array = NDArray[np.float64]

NODES = 12
"""View angles of the table, evenly spaced in √cos θ."""

_LEAST_COSINE = 2e-3
_ANGLES, _TURNS = 128, 32  # angles from R, denser toward it, and turns around it, of a lobe's mean over the turn
_MOST_ROWS = 252


def node_cosines() -> Array:
    """Cosines of the table's view angles, from grazing to head-on, shape (NODES,)."""
    return np.maximum(np.linspace(0, 1, NODES) ** 2, _LEAST_COSINE)


def isotropic_map(illumination: Array, lobes: Sequence[Lobe], rows: int) -> Array:
    """Light that the glossy parts of all lobes reflect, by view angle and mirror direction.

    Parameters
    ----------
    illumination : ndarray, shape (H, W, 3)
        Illumination table I [W sr⁻¹ m⁻²].
    lobes : sequence of (LobeShape, ndarray)
        Shape and directional albedo of each lobe.
    rows : int
        Rows of each layer, which has twice as many columns.

    Returns
    -------
    ndarray, shape (NODES, rows, 2 rows, 3)
        Radiance; under a constant sky of radiance 1 the albedo of the glossy parts.
    """
    albedo = MaterialFit.of(lobes, n=1.0).glossy
    wanted = resampled(albedo, cosines(), node_cosines())
    layers = []
    for cosine, energy in zip(node_cosines(), wanted, strict=True):
        x, lobe = mean_over_turn(lobes, cosine)
        layer = convolved(illumination, zonal(x, lobe), rows, 2 * rows)
        layers.append(4 * np.pi * energy * layer)  # the lobe's integral is 1
    return np.stack(layers)


def mean_over_turn(lobes: Sequence[Lobe], cosine: float) -> tuple[Array, Array]:
    """Glossy part of a material by the angle from R, as its mean over the turn around R.

    Parameters
    ----------
    lobes
        As of `isotropic_map`.
    cosine : float
        E·N.

    Returns
    -------
    x, values : ndarray, shape (angles,)
        Cosines from R in ascending order, and BRDF times cosine [sr⁻¹] of all channels together, with the integral 1
        over the sphere.
    """
    angle = np.pi * np.linspace(1, 0, _ANGLES) ** 3
    turn = (np.arange(_TURNS) + 0.5) * (2 * np.pi / _TURNS)
    view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    wi = _around(view * [-1, -1, 1], np.repeat(angle, _TURNS), np.tile(turn, _ANGLES))
    values = _glossy(lobes, wi, view).sum(axis=1).reshape(_ANGLES, _TURNS).mean(axis=1)
    integral = 2 * np.pi * np.trapezoid(values * np.sin(angle), -angle)
    return np.cos(angle), values / max(float(integral), 1e-30)


def radiance_by_turn(illumination: Array, lobes: Sequence[Lobe], r: Array, cosine: float, turns: int = 16) -> Array:
    """Radiance of the glossy parts for one mirror direction and view angle, at evenly spaced turns of the normal.

    Parameters
    ----------
    illumination, lobes
        As of `isotropic_map`.
    r : ndarray, shape (3,)
        Unit mirror direction R in world coordinates.
    cosine : float
        E·N = R·N.
    turns : int
        Normals, evenly around R.

    Returns
    -------
    ndarray, shape (turns, 3)
        Radiance by direct sums over the illumination table. All rows are equal where a table by R and E·N is complete.
    """
    height, width, _ = illumination.shape
    v, u = latitudes(height)[:, None], (np.arange(width) + 0.5) * (2 * np.pi / width)
    light = np.stack(np.broadcast_arrays(np.sin(v) * np.sin(u), np.cos(v), np.sin(v) * np.cos(u)), axis=-1)
    energy = (illumination * texel_areas(height, width)).reshape(-1, 3)
    tilt, turn = np.full(turns, np.arccos(cosine)), np.arange(turns) * (2 * np.pi / turns)
    found = []
    for n in _around(r, tilt, turn):
        # The surface's frame: viewer in the plane of x and z
        e = 2 * cosine * n - r
        x = (e - cosine * n) / max(np.sqrt(1 - cosine**2), 1e-9)
        local = light.reshape(-1, 3) @ np.stack([x, np.cross(n, x), n], axis=1)
        view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
        found.append((_glossy(lobes, local, view) * energy).sum(axis=0))
    return np.array(found)


def _around(axis: Array, angle: NDArray[np.floating], turn: NDArray[np.floating]) -> Array:
    """Unit directions at an angle from an axis, by the turn around it, shape (n, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(axis, helper)
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    sine = np.sin(angle)[:, None]
    return np.asarray(
        sine * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y) + np.cos(angle)[:, None] * np.asarray(axis)
    )


def _glossy(lobes: Sequence[Lobe], wi: Array, view: Array) -> Array:
    """BRDF times cosine [sr⁻¹] of the glossy parts of all lobes toward one view, zero below the horizon; (n, 3)."""
    total, above = np.zeros((len(wi), 3)), wi[:, 2] > 0
    probes = ProbeDirections(wi[above], np.tile(view, (int(above.sum()), 1)), np.ones(int(above.sum())))
    for shape, _ in lobes:
        if not shape.is_mirror:
            total[above] += shape_values(replace(shape, matte=0 * shape.matte), probes)
    return total


@dataclass(eq=False)
class IsotropicTable:
    """Shading W_d(E·N) D[N] + T[R, E·N], plus W_s(E·N) I[R] where the material has a delta lobe.

    Attributes
    ----------
    matte : TwoMaps
        D, and I for the delta lobe.
    table : PolarTable
        Table T, a layer a view angle.
    """

    matte: TwoMaps
    table: PolarTable

    def radiance(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """Radiance toward `v` from surfaces with normal `n`; see `Method.eval`."""
        cosine = dr.dot(n, v)
        place = dr.sqrt(dr.clip(cosine, 0, 1)) * (NODES - 1)
        below = dr.minimum(mi.UInt32(place), NODES - 2)
        r = 2 * cosine * n - v
        glossy = dr.lerp(self.table.fetch(r, below), self.table.fetch(r, below + 1), place - mi.Float(below))
        return self.matte.radiance(n, v) + glossy


@register(
    "miller1984-isotropic",
    summary="Miller & Hoffman (1984), section 9: a three-dimensional map by reflection and view angle",
    needs=Needs(light=True, lobes=True),
    sees_delta_lights=True,
    listed=False,
)
def isotropic(
    inputs: MethodInputs,
    *,
    lookup: Lookup = "bilinear",
    illumination_rows: int = _MOST_ROWS,
    diffuse_rows: int = DIFFUSE_ROWS,
    rows: int | None = None,
    points: int = POINTS,
) -> Miller1984:
    """Make the method.

    Parameters
    ----------
    inputs : MethodInputs
        Light and lobes of a bake.
    lookup, illumination_rows, diffuse_rows, points
        As of `miller1984`.
    rows : int, optional
        Rows of each layer, which has twice as many columns; by default as the fitted exponent asks, at most 252.
    """
    sizes = checked_sizes(lookup, points, illumination_rows, diffuse_rows, rows)
    lobes = list(inputs.shapes.values())
    fit, light = MaterialFit.of(lobes), illumination_table(inputs.light, illumination_rows)
    material = replace(fit, glossy=0 * fit.glossy).material()
    matte = two_maps(light, material, replace(sizes, specular=None), lookup)
    count = rows or min(phong_rows(fit.n, illumination_rows), _MOST_ROWS)
    table = PolarTable.of(isotropic_map(light, lobes, count), lookup)
    return Miller1984(inputs, IsotropicTable(matte, table), points, material, fit)
