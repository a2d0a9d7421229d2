"""Ratio of a lobe to its proxy, tabulated: it turns the fitted BRDF of single directions into the true one.

A fit of GGX lobes errs where it carries little energy: in the tail of a Beckmann lobe, or where light and viewer are
both at grazing angles. Under an extended light that is little of the result. Under a delta light it is all that some
texels show.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.split import LobeSplit

NODES = 33
"""Nodes of a table along each axis."""

_TURNS = 16  # azimuths over which a node averages
_LARGEST = 16.0  # ratio at most
_LEAST_COSINE = 1e-3
_TINY = 1e-9  # of a BRDF times cosine [sr⁻¹] below which a channel's ratio is 1


def glossy_place(wi: mi.Vector3f, wo: mi.Vector3f, alpha: mi.Float | float) -> mi.Point2f:
    """Place in the table of a glossy lobe: t/(t + α) with t = tan θ_h, and √(h·v); both in [0, 1]."""
    h = wi + wo
    h *= dr.rsqrt(dr.maximum(dr.squared_norm(h), 1e-12))
    cosine = dr.clip(h.z, _LEAST_COSINE, 1)
    tangent = dr.sqrt(dr.maximum(1 - cosine * cosine, 0)) / cosine
    return mi.Point2f(tangent / (tangent + alpha), dr.sqrt(dr.clip(dr.dot(h, wo), 0, 1)))


def matte_place(wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Point2f:
    """Place in the table of a matte lobe: √cos θ_i and √cos θ_o."""
    return mi.Point2f(dr.sqrt(dr.clip(wi.z, 0, 1)), dr.sqrt(dr.clip(wo.z, 0, 1)))


def proxy_ratios(split: LobeSplit) -> dict[str, NDArray[np.float32]]:
    """Tables of all lobes of a material that are not delta lobes.

    Parameters
    ----------
    split : LobeSplit
        Lobes and proxies of the material, in the RGB variant.

    Returns
    -------
    dict of str to ndarray, shape (NODES, NODES, 3)
        For each lobe f·ω_k over its proxy, means over the azimuth: rows by the second, columns by the first coordinate
        of `glossy_place` or `matte_place`, evenly spaced from 0 to 1. Nodes without directions above the surface have
        the value of the nearest node that has some.

    Examples
    --------
    >>> ratios = proxy_ratios(LobeSplit.of(mi.load_dict({"type": "diffuse"})))
    >>> bool(np.allclose(ratios["diffuse"], 1, atol=1e-3))
    True
    """
    smooth = [lobe for lobe in split.lobes if lobe.proxy is not None]
    return {lobe.name: _table(split, index, lobe.proxy) for index, lobe in enumerate(smooth) if lobe.proxy is not None}


def _table(split: LobeSplit, index: int, proxy: ProxyLobe) -> NDArray[np.float32]:
    wi, wo = _matte_directions() if proxy.is_matte else _glossy_directions(proxy.alpha)
    above = (wi[:, 2] > _LEAST_COSINE**2) & (wo[:, 2] > _LEAST_COSINE**2)
    d_i, d_o = (mi.Vector3f(np.ascontiguousarray(w.T, dtype=np.float32)) for w in (wi, wo))
    lobe, fitted = (_sums(value, above) for value in (split.parts(d_i, d_o)[index], proxy.brdf_cosine(d_i, d_o)))
    ratio = np.where(fitted > _TINY, np.clip(lobe / np.maximum(fitted, _TINY), 0, _LARGEST), 1)
    missing = ~above.reshape(NODES, NODES, _TURNS).any(axis=2)
    row, column = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(ratio[row, column], dtype=np.float32)


def _sums(value: mi.Color3f, above: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Sums over the azimuth, shape (NODES, NODES, 3)."""
    rows = np.broadcast_to(np.array(value, dtype=np.float64).reshape(3, -1).T, (len(above), 3))
    return np.asarray(np.where(above[:, None], rows, 0).reshape(NODES, NODES, _TURNS, 3).sum(axis=2))


def _grid() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Second coordinate, first coordinate, and azimuth [rad] of all directions, flat, the azimuth fastest."""
    places, turns = np.linspace(0, 1, NODES), (np.arange(_TURNS) + 0.5) * (np.pi / _TURNS)
    second, first, turn = np.meshgrid(places, places, turns, indexing="ij")
    return second.ravel(), first.ravel(), turn.ravel()


def _matte_directions() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    out, light, turn = _grid()
    cos_i, cos_o = (np.maximum(root**2, _LEAST_COSINE) for root in (light, out))
    sin_i, sin_o = (np.sqrt(1 - cosine**2) for cosine in (cos_i, cos_o))
    wi = np.stack([sin_i * np.cos(turn), sin_i * np.sin(turn), cos_i], axis=1)
    return wi, np.stack([sin_o, np.zeros_like(turn), cos_o], axis=1)


def _glossy_directions(alpha: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pairs by half vector h and difference: the light around h, the viewer mirrored at h (Rusinkiewicz 1998)."""
    root, share, turn = _grid()
    share = np.minimum(share, 1 - 1e-4)
    tangent, cos_d = alpha * share / (1 - share), np.maximum(root**2, _LEAST_COSINE)
    cos_h = 1 / np.sqrt(1 + tangent**2)
    sin_h, sin_d = tangent * cos_h, np.sqrt(1 - cos_d**2)
    x, y = sin_d * np.cos(turn), sin_d * np.sin(turn)
    wi = np.stack([cos_h * x + sin_h * cos_d, y, cos_h * cos_d - sin_h * x], axis=1)
    h = np.stack([sin_h, np.zeros_like(turn), cos_h], axis=1)
    return wi, 2 * (h * wi).sum(axis=1, keepdims=True) * h - wi
