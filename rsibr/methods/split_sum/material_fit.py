"""Fit of split-sum shading to any material: a GGX roughness and Schlick's two reflectances for each glossy lobe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from rsibr.lobes.albedo import node_cosines
from rsibr.lobes.basis import COAT_IOR
from rsibr.lobes.facet_moments import cosines, facet_moments, matte_energy
from rsibr.lobes.gaussians import LobeShape
from rsibr.lobes.microfacet import schlick
from rsibr.methods.split_sum.dfg import dfg

Array = NDArray[np.float64]

_ALPHAS = np.geomspace(1e-3, 1.5, 400)
_SLOPES = np.geomspace(1e-4, 30, 400)
_MEAN_GRAZING = 1 / 21  # mean of (1 − cos θ)⁵ over the cosine lobe


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
        Greatest difference of the cumulative distributions of slopes (Kolmogorov–Smirnov), of the lobe and of GGX.
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
    size = max(float((weights * glossy**2).sum()), 1e-30)
    error = float(np.sqrt((weights * (fitted - glossy) ** 2).sum() / size))
    return LobeFit(
        name, alpha, solved[:, 0], solved[:, 1], glossy, fitted, terms.sum(axis=1), albedo - glossy, slope_error, error
    )


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
    """Roughness α of the GGX distribution nearest to a lobe's Gaussians, and the greatest difference left.

    Parameters
    ----------
    shape : LobeShape
        A lobe that is no mirror. Slopes under a coat count by what they deflect in air, `COAT_IOR` times as much.

    Returns
    -------
    alpha : float
        Least ∫ (P − P_GGX)² d log t of the cumulative distributions of slopes t, P_GGX = t²/(α² + t²); 0 without a
        glossy part.
    error : float
        Greatest |P − P_GGX|.
    """
    sigmas = np.concatenate([shape.bare.sigmas, COAT_IOR * shape.coated.sigmas])
    weights = np.concatenate(
        [(one.plain + _MEAN_GRAZING * one.grazing).mean(axis=1) for one in (shape.bare, shape.coated)]
    )
    if not weights.any():
        return 0.0, 0.0
    squares = _SLOPES[:, None] ** 2
    held = (1 - np.exp(-squares / (2 * sigmas**2))) @ (weights / weights.sum())
    differences = held[:, None] - squares / (squares + _ALPHAS**2)
    errors = (differences**2).sum(axis=0)
    best = int(np.clip(errors.argmin(), 1, len(_ALPHAS) - 2))
    below, least, above = errors[best - 1 : best + 2]
    shift = 0.5 * (below - above) / max(below - 2 * least + above, 1e-30)  # vertex of the parabola
    alpha = float(_ALPHAS[best] * (_ALPHAS[1] / _ALPHAS[0]) ** np.clip(shift, -1, 1))
    return min(alpha, 1.0), float(np.abs(differences[:, best]).max())


def disk_weights() -> Array:
    """Weights of the nodes in the mean over the disk of a sphere map, 2 μ dμ; they sum to 1, shape (NODES,)."""
    squares = node_cosines() ** 2
    weights = np.gradient(squares)
    return np.asarray(weights / weights.sum())


def _schlick_terms() -> Array:
    """Terms of a mirror: F = F₀ (1 − w) + F₉₀ w, shape (NODES, 2)."""
    graze = schlick(node_cosines(), np)
    return np.stack([1 - graze, graze], axis=1)
