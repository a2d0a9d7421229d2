"""Direct fit of a lobe by Gaussians over microfacet slopes: the lobe's own shape.

The terms of the fit are those of `rsibr.lobes.basis` with a Gaussian in place of the GGX distribution, and one masking
for all. Whatever the lobe is, GGX, Beckmann, measured or a sum of several, it is fitted as it is. See docs/method.md,
section 4.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from rsibr.lobes.basis import COAT_IOR
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.microfacet import LEAST_COSINE, schlick, smith_denominator, transmitted
from rsibr.lobes.probe_directions import ProbeDirections, probe_directions
from rsibr.lobes.visible_facets import under_coat

Array = NDArray[np.float64]

WIDEST, NARROWEST, RATIO = 0.9, 0.003, 1.25
"""Standard deviations of the dictionary: widest, narrowest, and the ratio of neighbours."""

GRAZING_UP_TO = 0.4
"""Standard deviation above which there is no grazing term: with one a fit would mistake it for a matte base."""

COATED_FROM = 0.07
"""Standard deviation from which there is a coated term; narrower ones look the same without a coat."""

_MASKINGS = (0.25, 0.6)  # roughness α of further maskings; that of the principled clear coat is 0.25
_GOOD = 0.02
_FEW = 6  # terms of a fit up to which widths between those of the dictionary are tried
_FINER = 6  # steps between two widths of the dictionary
_FAINTEST = 1e-4  # share of the energy below which a term is left out
_FLOOR = 1e-3  # of the largest value, added to the values that a relative error refers to


@dataclass(frozen=True)
class _Term:
    """Term of the dictionary: its kind, and its standard deviation (0 for a cosine lobe)."""

    kind: str
    sigma: float


def fit_shape(values: Array, alpha: float, *, with_matte: bool) -> LobeShape:
    """Fit a lobe by Gaussians over slopes and, if it may be matte, cosine lobes.

    Parameters
    ----------
    values : ndarray, shape (n, 3)
        BRDF times cosine [sr⁻¹] of the lobe at `rsibr.lobes.probe_directions.probe_directions`.
    alpha : float
        Roughness α of the lobe's proxy, whose masking is tried first; `LAMBERT` for a matte lobe.
    with_matte : bool
        Whether a part of the lobe may follow the normal.

    Returns
    -------
    LobeShape
        At least one term has a weight, unless the lobe is black.

    Notes
    -----
    Non-negative least squares (Lawson & Hanson 1974), each channel by itself, of the relative error weighted by
    energy, ∫ err²/y. Terms with less than `_FAINTEST` of the energy are dropped and the others fitted anew. Unless the
    error (`angle_errors`) with the proxy's masking is within `_GOOD`, others are tried, and the best is taken.
    """
    best, least = None, np.inf
    for masking in (alpha, *_MASKINGS) if alpha > 0 else _MASKINGS:
        shape = _with_masking(values, round(min(masking, 1.0), 4), with_matte)
        error = float(angle_errors(values, shape_values(shape, probe_directions()), probe_directions()).mean())
        if error < least:
            best, least = shape, error
        if error <= _GOOD:
            break
    assert best is not None  # an error is a number
    return best


def angle_errors(values: Array, fitted: Array, probes: ProbeDirections) -> Array:
    """Relative error of a fitted kernel at each view angle: ∫ |f̂ − f| over ∫ f, with f̂ scaled to the energy of f.

    Parameters
    ----------
    values, fitted : ndarray, shape (n, 3)
        BRDF times cosine [sr⁻¹] of the lobe and of its fit, at `probes`.

    Returns
    -------
    ndarray, shape (angles,)
        Over the view angles of `probes`, in their order. Half of it is the share of the reflected light that is
        gathered from wrong directions: times the range of the light it bounds what the model errs by (docs/method.md,
        eq. 11).
    """
    errors = []
    for view in probes.views:
        wanted, found = (rows[view] / probes.density[view, None] for rows in (values, fitted))
        scale = wanted.sum(axis=0) / np.maximum(found.sum(axis=0), 1e-30)
        errors.append(np.abs(found * scale - wanted).sum() / max(float(wanted.sum()), 1e-30))
    return np.array(errors)


def _with_masking(values: Array, alpha: float, with_matte: bool) -> LobeShape:
    """Fit with the masking of roughness `alpha`: on the coarse dictionary, then with widths between the kept ones."""
    probes = probe_directions()
    weight = 1 / np.sqrt(probes.density[:, None] * (values + _FLOOR * values.max(axis=0, initial=1e-12) + 1e-6))
    terms, basis = _dictionary(alpha, with_matte)
    kept, weights = _fitted(basis, values, weight)
    found = [terms[k] for k in kept]
    if len(kept) <= _FEW:
        found = list(dict.fromkeys(near for term in found for near in _neighbours(term)))
        basis = np.stack([_values(term, alpha, probes) for term in found], axis=1)
        kept, weights = _fitted(basis, values, weight)
        found = [found[k] for k in kept]
    return _shape(alpha, found, weights)


def _neighbours(term: _Term) -> list[_Term]:
    """The term, and for a Gaussian those at finer steps to either side."""
    if term.sigma == 0:
        return [term]
    steps = RATIO ** (np.arange(1 - _FINER, _FINER) / _FINER)
    return [_Term(term.kind, float(f"{sigma:.6g}")) for sigma in term.sigma * steps]


def _fitted(basis: Array, values: Array, weight: Array) -> tuple[NDArray[np.intp], Array]:
    """Terms that carry energy, and their weights, shape (kept, 3)."""
    solved = _solved(basis, values, weight, np.arange(basis.shape[1]))
    energy = ((basis / probe_directions().density[:, None]).sum(axis=0)[:, None] * solved).sum(axis=1)
    kept = np.flatnonzero(energy > _FAINTEST * energy.sum())
    if not len(kept):  # a black lobe
        kept = np.arange(1)
    return kept, _solved(basis, values, weight, kept)[kept]


def _solved(basis: Array, values: Array, weight: Array, used: NDArray[np.intp]) -> Array:
    """Weights of the terms `used` in each channel; zero for the others."""
    solved = np.zeros((basis.shape[1], values.shape[1]))
    for channel in range(values.shape[1]):
        rows = weight[:, channel]
        solved[used, channel] = nnls(basis[:, used] * rows[:, None], values[:, channel] * rows)[0]
    return solved


def _shape(alpha: float, terms: Sequence[_Term], weights: Array) -> LobeShape:
    def mixture(*kinds: str) -> Gaussians:
        sigmas = np.unique([term.sigma for term in terms if term.kind in kinds])
        found = [np.zeros((len(sigmas), 3)) for _ in ("plain", "grazing")]
        for term, weight in zip(terms, weights, strict=True):
            if term.kind in kinds:
                found[int(term.kind == "grazing")][np.searchsorted(sigmas, term.sigma)] = weight
        return Gaussians(sigmas, *found)

    matte = np.zeros((2, 3))
    for term, weight in zip(terms, weights, strict=True):
        if term.kind in ("lambert", "coated lambert"):
            matte[int(term.kind == "coated lambert")] = weight
    return LobeShape(alpha, mixture("plain", "grazing"), mixture("coated"), matte)


def sigmas() -> Array:
    """Standard deviations of the dictionary, ascending."""
    steps = int(np.floor(np.log(WIDEST / NARROWEST) / np.log(RATIO)))
    return np.asarray(WIDEST * RATIO ** -np.arange(steps, -1, -1.0))


@lru_cache(maxsize=8)
def _dictionary(alpha: float, with_matte: bool) -> tuple[list[_Term], Array]:
    """Terms of the fit, and their values at the probe directions, shape (n, terms)."""
    probes = probe_directions()
    terms = [_Term("plain", sigma) for sigma in sigmas()]
    terms += [_Term("grazing", sigma) for sigma in sigmas() if sigma <= GRAZING_UP_TO]
    terms += [_Term("coated", sigma) for sigma in sigmas() if sigma >= COATED_FROM]
    if with_matte:
        terms += [_Term("lambert", 0.0), _Term("coated lambert", 0.0)]
    return terms, np.stack([_values(term, alpha, probes) for term in terms], axis=1)


def shape_values(shape: LobeShape, probes: ProbeDirections) -> Array:
    """BRDF times cosine [sr⁻¹] of a shape that is no mirror, shape (n, 3)."""
    total = np.zeros((len(probes.wi), 3))
    for kind, mixture in (("plain", shape.bare), ("coated", shape.coated)):
        for sigma, weight in zip(mixture.sigmas, mixture.plain, strict=True):
            total += _values(_Term(kind, sigma), shape.alpha, probes)[:, None] * weight
    for sigma, weight in zip(shape.bare.sigmas, shape.bare.grazing, strict=True):
        total += _values(_Term("grazing", sigma), shape.alpha, probes)[:, None] * weight
    for kind, weight in zip(("lambert", "coated lambert"), shape.matte, strict=True):
        total += _values(_Term(kind, 0.0), shape.alpha, probes)[:, None] * weight
    return total


def _values(term: _Term, alpha: float, probes: ProbeDirections) -> Array:
    """BRDF times cosine [sr⁻¹] of a term with weight 1; docs/method.md, eq. 8."""
    wi, wo = probes.wi, probes.wo
    match term.kind:
        case "lambert":
            return np.maximum(wi[:, 2], 0) / np.pi
        case "coated lambert":
            return np.asarray(np.maximum(wi[:, 2], 0) / np.pi * transmitted(wi[:, 2], np) * transmitted(wo[:, 2], np))
        case "plain":
            return gaussian(wi, wo, term.sigma, alpha)[0]
        case "grazing":
            plain, toward = gaussian(wi, wo, term.sigma, alpha)
            return np.asarray(plain * schlick(toward, np))
        case _:
            return coated_gaussian(wi, wo, term.sigma, alpha)[0]


def coated_gaussian(wi: Array, wo: Array, sigma: float, alpha: float) -> tuple[Array, Array]:
    """The same as `gaussian` under a coat, and h·ω_o there."""
    inner_i, inner_o = under_coat(wi), under_coat(wo)
    below, toward = gaussian(inner_i, inner_o, sigma, alpha)
    bent = np.maximum(wi[:, 2], 0) / (inner_i[:, 2] * COAT_IOR * COAT_IOR)
    return np.asarray(below * bent * transmitted(wi[:, 2], np) * transmitted(wo[:, 2], np)), toward


def gaussian(wi: Array, wo: Array, sigma: float, alpha: float) -> tuple[Array, Array]:
    """D G₂ / (4 cos θ_o) of Gaussian slopes, and h·ω_o."""
    h = wi + wo
    h /= np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-12)
    cos_h = np.maximum(h[:, 2], 1e-6)
    squared = (h[:, 0] ** 2 + h[:, 1] ** 2) / cos_h**2
    density = np.exp(-0.5 * squared / sigma**2) / (2 * np.pi * sigma**2 * cos_h**4)
    cos_i, cos_o = np.maximum(wi[:, 2], LEAST_COSINE), np.maximum(wo[:, 2], LEAST_COSINE)
    shadowing = smith_denominator(cos_i, cos_o, alpha, np)
    return density * cos_i / (2 * shadowing), (h * wo).sum(axis=1)
