"""Fit of split-sum shading to any material: a GGX roughness and Schlick's two reflectances for each glossy lobe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from rsibr.lobes.albedo import node_cosines, over_disk
from rsibr.lobes.facet_moments import cosines, facet_moments, matte_energy
from rsibr.lobes.gaussians import LobeShape
from rsibr.lobes.microfacet import ggx_density, schlick
from rsibr.lobes.probe_directions import ProbeDirections
from rsibr.lobes.shape_fit import shape_values
from rsibr.methods.split_sum.dfg import dfg

Array = NDArray[np.float64]

_ALPHAS = np.geomspace(1e-3, 1.0, 200)
_ANGLES = np.geomspace(1e-4, np.pi / 2, 500)


@dataclass(frozen=True, eq=False)
class LobeFit:
    """A lobe as split-sum shading holds it.

    Attributes
    ----------
    name : str
        Name of the lobe.
    alpha : float
        Roughness α of GGX; 0 for a delta lobe.
    f0, f90 : ndarray, shape (3,)
        Reflectance head-on and at grazing angles.
    exact, fitted : ndarray, shape (NODES, 3)
        Directional albedo of the lobe's glossy part at `rsibr.lobes.albedo.node_cosines`, and that of the fit.
    scattered_once : ndarray, shape (NODES,)
        Albedo A + B of GGX without a Fresnel term.
    matte : ndarray, shape (NODES, 3)
        Directional albedo of the lobe's matte part.
    slope_error : float
        Greatest difference of the shares of light within an angle, of the lobe and of GGX, head-on; `nearest_alpha`.
    albedo_error : float
        Root mean square of `fitted` − `exact` over the disk of a sphere map, over that of `exact`.
    """

    name: str
    alpha: float
    f0: Array
    f90: Array
    exact: Array
    fitted: Array
    scattered_once: Array
    matte: Array
    slope_error: float
    albedo_error: float

    @property
    def error(self) -> float:
        """The larger of the two errors."""
        return max(self.slope_error, self.albedo_error)


def fit_lobe(name: str, shape: LobeShape, albedo: Array) -> LobeFit:
    """Fit a lobe.

    Parameters
    ----------
    name : str
        Its name.
    shape : LobeShape
        Its shape.
    albedo : ndarray, shape (NODES, 3)
        Its directional albedo, of which the matte part gets its share of the shape's energy.
    """
    glossy = glossy_share(shape) * albedo
    alpha, slope_error = (0.0, 0.0) if shape.is_mirror else nearest_alpha(shape)
    terms = _schlick_terms() if alpha == 0 else dfg(node_cosines(), np.array([alpha]))[0]
    weights = disk_weights()[:, None]
    solved = np.stack([nnls(terms * np.sqrt(weights), (glossy * np.sqrt(weights))[:, k])[0] for k in range(3)])
    fitted = terms @ solved.T
    size = max(float(over_disk(glossy**2).sum()), 1e-30)
    error = float(np.sqrt(over_disk((fitted - glossy) ** 2).sum() / size))
    return LobeFit(
        name, alpha, solved[:, 0], solved[:, 1], glossy, fitted, terms.sum(axis=1), albedo - glossy, slope_error, error
    )


def mean_error(fits: Sequence[LobeFit]) -> float:
    """Mean of the lobes' errors, weighted by the albedo of their glossy parts over the disk; 0 without any."""
    weights = np.array([over_disk(fit.exact).sum() for fit in fits])
    errors = np.array([fit.error for fit in fits])
    return float((weights * errors).sum() / max(float(weights.sum()), 1e-30))


def glossy_share(shape: LobeShape) -> Array:
    """Share of the glossy part in the energy of a lobe, shape (NODES, 3)."""
    if shape.is_mirror:
        return np.ones((len(node_cosines()), 3))
    matte = matte_energy(shape.matte)
    glossy = sum((one.weight for one in facet_moments(shape)), start=np.zeros_like(matte))
    share = glossy / np.maximum(glossy + matte, 1e-30)
    place, nodes = np.sqrt(node_cosines()), np.sqrt(cosines())
    return np.stack([np.interp(place, nodes, channel) for channel in share.T], axis=1)


def nearest_alpha(shape: LobeShape) -> tuple[float, float]:
    """Roughness α of the GGX lobe nearest to the glossy part of a lobe seen head-on, and the difference left.

    Parameters
    ----------
    shape : LobeShape
        A lobe that is no mirror.

    Returns
    -------
    alpha : float
        Least ∫ (P − P_GGX)² d log θ of the shares of the reflected light within the angle θ of the normal. Head-on,
        half vectors lie at θ/2: these are distributions of slopes, as far as they are seen. 0 without a glossy part.
    error : float
        Greatest |P − P_GGX| (Kolmogorov–Smirnov).
    """
    held = _head_on(shape)
    if held[-1] <= 0:
        return 0.0, 0.0
    differences = (held / held[-1])[:, None] - _ggx_head_on()
    errors = (differences**2).sum(axis=0)
    best = int(np.clip(errors.argmin(), 1, len(_ALPHAS) - 2))
    below, least, above = errors[best - 1 : best + 2]
    shift = 0.5 * (below - above) / max(below - 2 * least + above, 1e-30)  # vertex of the parabola
    alpha = float(_ALPHAS[best] * (_ALPHAS[1] / _ALPHAS[0]) ** np.clip(shift, -1, 1))
    return alpha, float(np.abs(differences[:, best]).max())


def _head_on(shape: LobeShape) -> Array:
    """Light that the glossy part reflects within each angle of the normal, for v = n; shape (angles,)."""
    flat = np.zeros(len(_ANGLES))
    wi = np.stack([np.sin(_ANGLES), flat, np.cos(_ANGLES)], axis=1)
    probes = ProbeDirections(wi, np.broadcast_to([0.0, 0.0, 1.0], wi.shape), flat + 1)
    values = shape_values(replace(shape, matte=np.zeros((2, 3))), probes).mean(axis=1)
    return _within(values[:, None])[:, 0]


@cache
def _ggx_head_on() -> Array:
    """The same of GGX without a Fresnel term, over the whole; shape (angles, alphas)."""
    cosine = np.cos(_ANGLES)[:, None]
    shadowing = 2 * cosine / (cosine + np.sqrt(_ALPHAS**2 + (1 - _ALPHAS**2) * cosine**2))
    held = _within(ggx_density(np.cos(_ANGLES / 2)[:, None], _ALPHAS) * shadowing)
    return np.asarray(held / held[-1])


def _within(values: Array) -> Array:
    """Running integral over the sphere of values (angles, …) that depend on the angle to the normal alone."""
    steps = np.diff(_ANGLES)[:, None]
    ring = values * np.sin(_ANGLES)[:, None]
    start = ring[:1] * (_ANGLES[0] / 2)
    return np.concatenate([start, start + np.cumsum(0.5 * steps * (ring[1:] + ring[:-1]), axis=0)])


def disk_weights() -> Array:
    """Weights of the nodes in the mean over the disk of a sphere map, 2 μ dμ; they sum to 1, shape (NODES,)."""
    squares = node_cosines() ** 2
    weights = np.gradient(squares)
    weights[[0, -1]] /= 2
    return np.asarray(weights / weights.sum())


def _schlick_terms() -> Array:
    """Terms of a mirror: F = F₀ (1 − w) + F₉₀ w, shape (NODES, 2)."""
    graze = schlick(node_cosines(), np)
    return np.stack([1 - graze, graze], axis=1)
