"""Interreflection between a clear coat and the paint below it, all orders, tabulated. NumPy only.

The coat is a plane dielectric layer with absorption. Below it are pigment (Lambert) and glossy lobes (GGX), which
depend only on the two polar angles and the difference of azimuth. Each Fourier order m of that difference is therefore
a matrix (Chandrasekhar 1950; Jakob et al. 2014, *A comprehensive framework for rendering layered materials*), and the
interreflection below the coat is a geometric series of matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Array = NDArray[np.float64]

COSINE_NODES = 65
"""Nodes of the one-dimensional tables, uniform in √cos θ outside the coat: densest at grazing angles."""

SINE_NODES = 25
"""Nodes of `CoatTables.interreflection`, uniform in sin θ outside the coat."""

AZIMUTH_NODES = 33
"""Nodes of `CoatTables.interreflection`, uniform in the difference of azimuth from 0 to π."""

_QUADRATURE = 40  # Gauss–Legendre nodes on each side of the critical angle
_AZIMUTHS = 128  # intervals from 0 to π; a multiple of AZIMUTH_NODES - 1
_SCALINGS = 30
_VISIBLE_NORMALS = 64  # points a side of the quadrature for directional albedos


@dataclass(frozen=True)
class Gloss:
    """Glossy lobe of the paint: GGX microfacets of constant reflectance inside the coat.

    Attributes
    ----------
    reflectance : tuple of C floats
        Reflectance of one microfacet times the area share of the microfacets, per channel, in [0, 1].
    alpha : float
        GGX roughness α.
    backward : bool
        Whether the lobe is rotated by π about the normal, so that it peaks at the incident direction.
    """

    reflectance: tuple[float, ...]
    alpha: float
    backward: bool = False


@dataclass(frozen=True, eq=False)
class CoatTables:
    """Tables from which the paint's BRDF is evaluated, for C colour channels.

    Attributes
    ----------
    coat : ndarray, shape (COSINE_NODES,)
        Directional albedo of the coat's surface, relative to the Fresnel reflectance of a smooth one.
    entry : ndarray, shape (COSINE_NODES, C)
        Light that reaches the pigment for the first time, directly or by reflections between glossy lobes and coat,
        relative to the light incident on the paint: at least 1.
    diffuse : ndarray, shape (C,)
        Reflectance of the pigment with all orders of reflection at the coat; may exceed 1.
    interreflection : ndarray, shape (AZIMUTH_NODES, SINE_NODES, SINE_NODES, C)
        BRDF inside the coat [sr⁻¹] of all paths with two or more glossy reflections and no diffuse one.
    albedo : ndarray, shape (COSINE_NODES, 2 + lobes)
        Directional albedo outside, mean of the channels, of pigment, coat, and each glossy lobe (single reflection).
    """

    coat: Array
    entry: Array
    diffuse: Array
    interreflection: Array
    albedo: Array


def fresnel(cosine: Array, eta: float) -> Array:
    """Fresnel reflectance of a smooth dielectric for unpolarised light from outside at cos θ = `cosine`; eta ≥ 1."""
    inner = inner_cosine(cosine, eta)
    s = (cosine - eta * inner) / (cosine + eta * inner)
    p = (eta * cosine - inner) / (eta * cosine + inner)
    return (s**2 + p**2) / 2


def inner_cosine(cosine: Array, eta: float) -> Array:
    """Cosine of the refracted angle inside the coat, by Snell's law."""
    return np.sqrt(1 - (1 - cosine**2) / eta**2)


def cosine_nodes() -> Array:
    """Cosines outside the coat at the nodes of the one-dimensional tables, shape (COSINE_NODES,)."""
    return np.linspace(0, 1, COSINE_NODES) ** 2


@lru_cache(maxsize=32)
def solve_layers(
    eta: float, coat_alpha: float, depth: tuple[float, ...], pigment: tuple[float, ...], lobes: tuple[Gloss, ...]
) -> CoatTables:
    """Tabulate the interreflection of a coat over pigment and glossy lobes, in 0.25 s; results are cached.

    Parameters
    ----------
    eta : float
        Index of refraction of the coat, > 1.
    coat_alpha : float
        GGX roughness α of its outer surface; 0 is smooth.
    depth : tuple of C floats
        Optical depth of the coat along the normal.
    pigment : tuple of C floats
        Reflectance of the pigment times the area share that it covers.
    lobes : tuple of Gloss
        At least one; its reflectance may be zero.

    Notes
    -----
    Exact for a smooth coat, up to quadrature. A rough coat refracts, and reflects from inside, like a smooth one whose
    transmittance is one minus the albedo of the rough surface, which conserves energy.
    """
    # Modes of single reflections by each glossy lobe, at the tables' nodes and between quadrature nodes
    outer = np.maximum(cosine_nodes(), 1e-9)
    coat = _albedo(outer, coat_alpha, eta)
    inside = _Inside(eta, outer, coat, np.array(depth))
    tilted = np.sqrt(1 - (np.linspace(0, 1, SINE_NODES) / eta) ** 2)
    rows = [inner_cosine(outer, eta), tilted, inside.cosine]
    by_lobe = [_lobe_modes(rows, inside, lobe) for lobe in lobes]
    # Series of reflections, one channel at a time
    entry, diffuse, between, albedo = [], [], [], []
    for c, reflectance in enumerate(pigment):
        at_entry, at_table, at_inside = (
            np.sum([lobe.reflectance[c] * modes[i] for lobe, modes in zip(lobes, by_lobe, strict=True)], axis=0)
            for i in range(3)
        )
        series = _Series(at_inside, inside.returned[:, c])
        arrived = 1 + at_inside[..., 0] @ series.once
        entry.append(1 + at_entry[..., 0] @ series.once)
        diffuse.append(reflectance / (1 - reflectance * 2 * inside.returned[:, c] @ arrived))
        between.append(series.between(at_table))
        leaving = 2 * inside.escaping[:, c] @ arrived
        single = [
            lobe.reflectance[c] * modes[0][..., 0] @ inside.escaping[:, c]
            for lobe, modes in zip(lobes, by_lobe, strict=True)
        ]
        albedo.append(inside.entering[:, c, None] * np.stack([diffuse[c] * leaving * entry[c], *single], axis=-1))
    shares = np.insert(np.mean(albedo, axis=0), 1, coat, axis=1)
    return CoatTables(coat / fresnel(outer, eta), np.stack(entry, -1), np.array(diffuse), np.stack(between, -1), shares)


class _Inside:
    """Quadrature over the cosines inside the coat, on both sides of the critical angle.

    Attributes
    ----------
    cosine, flux : ndarray, shape (Q,)
        Nodes μ and weights μ dμ.
    returned, escaping : ndarray, shape (Q, C)
        Weight times the share of the light leaving the paint that returns to it, and that escapes from the coat.
    entering : ndarray, shape (COSINE_NODES, C)
        Share of the light from outside that is transmitted to the paint.
    """

    def __init__(self, eta: float, outer: Array, coat: Array, depth: Array) -> None:
        x, w = np.polynomial.legendre.leggauss(_QUADRATURE)
        x, w = (x + 1) / 2, w / 2
        critical = np.sqrt(1 - 1 / eta**2)
        # Beyond the critical angle Fresnel reflectance is smooth in the cosine outside
        self.cosine = np.concatenate([critical * x, inner_cosine(x, eta)])
        self.flux = np.concatenate([critical**2 * x * w, x * w / eta**2])
        reflected = fresnel(x, eta) * np.interp(np.sqrt(x), np.sqrt(outer), coat / fresnel(outer, eta))
        transmitted = np.concatenate([np.zeros_like(x), 1 - reflected])[:, None]
        absorbed = np.exp(-depth / self.cosine[:, None])
        self.returned = self.flux[:, None] * (1 - transmitted) * absorbed**2
        self.escaping = self.flux[:, None] * transmitted * absorbed
        self.entering = (1 - coat)[:, None] * np.exp(-depth / inner_cosine(outer, eta)[:, None])


class _Series:
    """Geometric series of glossy reflections below the coat, one channel.

    With S_m the modes of one reflection and P the diagonal matrix of the coat's internal reflection, all orders are
    S + S P (1 − S P)⁻¹ S. Reflection at the coat rotates the azimuth by π, a factor (−1)^m. With √P on both sides the
    matrices are symmetric, in agreement with Helmholtz reciprocity.
    """

    def __init__(self, reflection: Array, returned: Array) -> None:
        self._root = np.sqrt(returned)
        self._turns = _half_turns(reflection.shape[-1])[:, None, None]
        orders = self._turns * self._root[:, None] * np.moveaxis(reflection, -1, 0) * self._root
        self._sum = np.linalg.inv(np.eye(len(returned)) - orders)
        self.once = self._root * (self._sum[0] @ self._root)
        """Factors that sum a glossy reflection to the light that reaches the pigment, all orders."""

    def between(self, table: Array) -> Array:
        """BRDF of two or more reflections, shape (AZIMUTH_NODES, n, n), from modes of shape (n, Q, modes)."""
        rows = np.moveaxis(table, -1, 0) * self._root
        modes = self._turns * (rows @ self._sum @ rows.swapaxes(-1, -2))
        values = dct(modes, type=1, axis=0)[:: _AZIMUTHS // (AZIMUTH_NODES - 1)] / (2 * np.pi)
        return np.asarray(np.maximum((values + values.swapaxes(-1, -2)) / 2, 0))


def _lobe_modes(rows: Sequence[Array], inside: _Inside, lobe: Gloss) -> list[Array]:
    """Modes between each set of cosines and the quadrature nodes.

    A narrow lobe at grazing angles falls between the nodes. The modes are therefore scaled, symmetrically, to the exact
    albedos of the lobe: the series would amplify any error in energy.
    """
    inner = _modes(inside.cosine, inside.cosine, lobe)
    exact = _albedo(inside.cosine, lobe.alpha)
    scale = np.ones_like(exact)
    for _ in range(_SCALINGS):
        scale = np.sqrt(scale * exact / (inner[..., 0] @ (scale * inside.flux)))
    modes = [_modes(row, inside.cosine, lobe) * scale[:, None] for row in rows]
    return [
        m * (_albedo(row, lobe.alpha) / (m[..., 0] @ inside.flux))[:, None, None]
        for m, row in zip(modes, rows, strict=True)
    ]


def _modes(rows: Array, columns: Array, lobe: Gloss) -> Array:
    """Fourier modes ∫ f cos(mφ) dφ over [0, 2π] of one glossy lobe, shape (rows, columns, modes)."""
    azimuth = np.linspace(0, np.pi, _AZIMUTHS + 1)
    values = _ggx(rows[:, None, None], columns[None, :, None], azimuth, lobe.alpha)
    modes = dct(values, type=1, axis=-1) * (np.pi / _AZIMUTHS)
    return np.asarray(modes * _half_turns(_AZIMUTHS + 1) if lobe.backward else modes)


def _half_turns(modes: int) -> Array:
    return np.where(np.arange(modes) % 2, -1.0, 1.0)


def _ggx(cos_a: Array, cos_b: Array, azimuth: Array, alpha: float) -> Array:
    """BRDF [sr⁻¹] of perfectly reflecting GGX microfacets between two directions (Walter et al. 2007)."""
    sines = np.sqrt((1 - cos_a**2) * (1 - cos_b**2))
    half_squared = 2 + 2 * (sines * np.cos(azimuth) + cos_a * cos_b)
    cos_h_squared = (cos_a + cos_b) ** 2 / half_squared
    normals = alpha**2 / (np.pi * (1 - (1 - alpha**2) * cos_h_squared) ** 2)
    return normals * _smith_g1(cos_a, alpha) * _smith_g1(cos_b, alpha) / (4 * cos_a * cos_b)


def _smith_g1(cosine: Array, alpha: float) -> Array:
    """Smith's masking term G₁ of GGX (Walter et al. 2007, eq. 34)."""
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)))


def _albedo(cosine: Array, alpha: float, eta: float | None = None) -> Array:
    """Directional albedo of GGX microfacets: dielectric, or perfectly reflecting without `eta`.

    Mean of F·G₁ over the visible normals, sampled by spherical caps (Dupuy & Benyoub 2023) from a stratified square.
    """
    if alpha == 0:
        return fresnel(cosine, eta) if eta else np.ones_like(cosine)
    # Visible normals: points of a spherical cap, mapped from the hemisphere to the ellipsoid
    u = (np.arange(_VISIBLE_NORMALS) + 0.5) / _VISIBLE_NORMALS
    phi, height = 2 * np.pi * u[:, None], u[None, :]
    view_z, view_x = cosine[:, None, None], np.sqrt(1 - cosine[:, None, None] ** 2)
    length = np.hypot(alpha * view_x, view_z)
    z = 1 - height * (1 + view_z / length)
    sine = np.sqrt(np.maximum(0, 1 - z**2))
    x, y = alpha * (sine * np.cos(phi) + alpha * view_x / length), alpha * sine * np.sin(phi)
    z = np.maximum(0, z + view_z / length)
    length = np.sqrt(x**2 + y**2 + z**2)
    # Mean of F·G₁ over the reflected directions
    facing = np.clip((view_x * x + view_z * z) / length, 0, 1)
    out = 2 * facing * z / length - view_z
    lit = np.where(out > 0, _smith_g1(np.maximum(out, 1e-9), alpha), 0)
    return np.asarray(np.mean(lit * (fresnel(facing, eta) if eta else 1.0), axis=(1, 2)))
