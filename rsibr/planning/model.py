"""Model by which a plan estimates errors: lobes as filters of the environment's spherical harmonics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.viewpoints import VIEW_COUNTS
from rsibr.light.harmonics import LMAX
from rsibr.light.probe import UNRESOLVED, LightProbe
from rsibr.planning.material_probe import LobeProbe

SECOND_MOMENT = 0.4
"""Variance of a GGX lobe over half-vectors, relative to α²; measured lobes have 0.35 to 0.5."""

_FARTHEST = 0.6524
"""Angle [rad] from the centroid of an icosahedron's face to its vertices; about halved by each subdivision."""

_NORMALS = 2**12


def attenuation(lobe: LobeProbe, lmax: int = LMAX) -> NDArray[np.float64]:
    """Factor by which a lobe attenuates each band of the environment, shape (lmax + 1,).

    Notes
    -----
    Lambert: Ramamoorthi & Hanrahan (2001), eq. 8, over π. Glossy: a Gaussian of the lobe's width in reflection space,
    2σ across and 2σ cos θ along the wider axis, mean over the disk; exp(−l(l+1) σ²/2).
    """
    bands = np.arange(lmax + 1)
    if lobe.kind == "mirror":
        return np.ones(lmax + 1)
    if lobe.kind == "diffuse":
        return _lambert_factors(lmax)
    return np.asarray(np.exp(-bands * (bands + 1) * reflected_variance(lobe.alpha) / 2))


def reflected_variance(alpha: float) -> float:
    """Variance [rad²] of a GGX lobe around its mirror direction, mean of both axes and over the disk."""
    return 4 * SECOND_MOMENT * alpha**2 * 0.75  # ⟨(1 + cos² θ)/2⟩ over the disk


def relative_power(lobe: LobeProbe, light: LightProbe) -> float:
    """⟨L²⟩/⟨L⟩² of the environment filtered by the lobe: 1 if constant, `UNRESOLVED` for a source without extent."""
    if light.variance == UNRESOLVED:
        return UNRESOLVED
    factors = attenuation(lobe) ** 2
    return float((light.bands * factors).sum() + light.beyond * factors[-1]) * (1 + light.variance)


def interpolation_error(lobe: LobeProbe, left_out: float, light: LightProbe, views: int) -> float:
    """Estimated error (relMSE) of a glossy lobe interpolated between stored views, before any correction.

    Parameters
    ----------
    lobe : LobeProbe
        The lobe; lobes of other kinds have no error.
    left_out : float
        relMSE of leaving the lobe out: its weight in the whole.
    light : LightProbe
        Measurements of the environment.
    views : int
        Number of stored views.

    Notes
    -----
    A warped source has the lobe covariance of another view angle; to second order its error is ½ ΔM : ∇∇L. Averaged
    over an isotropic field, ⟨H_ij H_kl⟩ = (δ_ij δ_kl + δ_ik δ_jl + δ_il δ_jk)/8 · ⟨(∇²L)²⟩, with ∇² the Laplacian on
    the sphere, −l(l+1) in band l. Power beyond the last band is treated as if in the worst one.
    """
    if lobe.kind != "glossy" or light.is_black:
        return 0.0
    trace, frobenius = _covariance_change(_FARTHEST / 2 ** max(0, _level(views)))
    scale = (4 * SECOND_MOMENT * lobe.alpha**2) ** 2
    return float(left_out * min(1.0, _curvature(lobe, light) * scale * (trace + 2 * frobenius) / 32))


def _curvature(lobe: LobeProbe, light: LightProbe) -> float:
    """⟨(∇²L)²⟩/⟨L²⟩ of the environment filtered by a glossy lobe [rad⁻⁴]."""
    variance = reflected_variance(lobe.alpha)
    if light.variance == UNRESOLVED:
        return 2 / variance**2  # of a Gaussian spot, in the plane
    bands = np.arange(LMAX + 1)
    worst = max(float(LMAX * (LMAX + 1)), 2 / variance)
    laplacian = float((light.bands * (bands * (bands + 1)) ** 2 * attenuation(lobe) ** 2).sum())
    laplacian += light.beyond * worst**2 * np.exp(-worst * variance)
    return float(laplacian * (1 + light.variance) / relative_power(lobe, light))


def _level(views: int) -> int:
    return int(np.argmin(np.abs(np.log(np.array(VIEW_COUNTS) / max(views, 1)))))


def _lambert_factors(lmax: int) -> NDArray[np.float64]:
    factors = np.zeros(lmax + 1)
    factors[:2] = 1, 2 / 3
    even = 1.0
    for band in range(2, lmax + 1, 2):  # l! / (2^l (l/2)!²), by its ratio
        even *= (band - 1) / band
        factors[band] = 2 * (-1) ** (band // 2 - 1) / ((band + 2) * (band - 1)) * even
    return factors


def _covariance_change(distance: float) -> tuple[float, float]:
    """Mean over the disk of tr² and of the squared norm of the blended ΔM at a centroid, in units of its scale."""
    # Normals, mirror directions and lobe covariance of the centroid's view
    index = np.arange(_NORMALS) + 0.5
    radius, turn = np.sqrt(index / _NORMALS), index * np.pi * (3 - 5**0.5)  # Fibonacci spiral: uniform over the disk
    n = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=1)
    z = np.array([0.0, 0.0, 1.0])
    r = 2 * n[:, 2:] * n - z
    a, b = _tangents(r, np.broadcast_to(z, r.shape))
    own = _covariance(a, b, n[:, 2], a, b)
    # Mean difference from the covariances of the three stored views
    blended = np.zeros_like(own)
    for azimuth in np.arange(3) * 2 * np.pi / 3:
        v = np.array([np.sin(distance) * np.cos(azimuth), np.sin(distance) * np.sin(azimuth), np.cos(distance)])
        cosine = np.sqrt(np.maximum((1 + r @ v) / 2, 0))
        a_i, b_i = _tangents(r, np.broadcast_to(v, r.shape))
        blended += (own - _covariance(a_i, b_i, cosine, a, b)) / 3
    trace = np.trace(blended, axis1=1, axis2=2)
    return float((trace**2).mean()), float((blended**2).sum(axis=(1, 2)).mean())


def _tangents(r: NDArray[np.float64], v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit tangents at r in the plane of incidence and across it."""
    across = np.cross(r, v)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    return np.cross(across, r), across


def _covariance(
    a: NDArray[np.float64], b: NDArray[np.float64], cosine: NDArray[np.float64],
    x: NDArray[np.float64], y: NDArray[np.float64],
) -> NDArray[np.float64]:  # fmt: skip
    """A aᵀ + cos² θ b bᵀ in the basis (x, y), shape (n, 2, 2)."""
    along = np.stack([(a * x).sum(1), (a * y).sum(1)], axis=1)
    across = np.stack([(b * x).sum(1), (b * y).sum(1)], axis=1)
    return np.asarray(
        along[:, :, None] * along[:, None] + (cosine**2)[:, None, None] * across[:, :, None] * across[:, None]
    )
