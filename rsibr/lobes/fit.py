"""Fit of proxy lobes to an isotropic BRDF, one colour channel at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from rsibr.errors import InputError
from rsibr.lobes.basis import LAMBERT, lobe_values
from rsibr.lobes.bsdf_eval import reflected
from rsibr.lobes.components import LEAST_SHARE, told_apart
from rsibr.lobes.probe_directions import probe_directions

ROUGHNESSES: tuple[float, ...] = (LAMBERT, *np.geomspace(0.004, 1.0, 24).tolist())
"""Roughness α of the dictionary's lobes."""

WIDEST_GAP = 1.9
"""Ratio of neighbouring roughnesses above which fitted terms belong to two lobes, not to one between two entries."""

MOST_GLOSSY = 2
"""Largest number of fitted glossy lobes: a coat and a base. Each is a layer in every map. BSDF components that can be
evaluated separately have at least one each."""

ALL_BUT_MATTE = 0.35, 0.05
"""Least roughness and largest share of the energy at which a fitted lobe is merged into the matte one: it corrects the
matte proxy rather than being a lobe of its own."""

_TINY = 1e-12


@dataclass(frozen=True)
class ProxyLobe:
    """Proxy lobe: a sum of basis functions of similar roughness.

    Attributes
    ----------
    alphas : tuple of float
        Roughness of each; `LAMBERT` for a matte lobe.
    coefficients : tuple of ndarray, each of shape (terms, 3)
        Coefficient of each basis function of that roughness in each channel, ≥ 0; see `rsibr.lobes.basis.lobe_values`.
    component : int or None
        BSDF component that it represents, in whole or in part; None if components cannot be evaluated separately.
    """

    alphas: tuple[float, ...]
    coefficients: tuple[NDArray[np.float64], ...]
    component: int | None = None

    @property
    def is_matte(self) -> bool:
        """Whether the lobe follows the normal."""
        return LAMBERT in self.alphas

    @property
    def alpha(self) -> float:
        """Geometric mean roughness, weighted by energy at normal incidence; `LAMBERT` for a matte lobe."""
        if self.is_matte:
            return LAMBERT
        # Grazing terms are small at normal incidence
        weights = [float(c.sum() - 0.95 * c[1:2].sum()) + _TINY for c in self.coefficients]
        return float(np.exp(np.average(np.log(self.alphas), weights=weights)))

    def brdf_cosine(self, wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Color3f:
        """BRDF times cosine of the light [sr⁻¹] of the proxy, for unit directions in the surface's frame."""
        total = mi.Color3f(0)
        for alpha, colours in zip(self.alphas, self.coefficients, strict=True):
            for value, colour in zip(lobe_values(wi, wo, alpha), colours, strict=False):
                total += value * mi.Color3f(*colour.tolist())
        return total


def fit_lobes(bsdf: mi.BSDF) -> list[ProxyLobe]:
    """Fit a BRDF by a few proxy lobes, widest first.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any isotropic BSDF; its delta components are ignored.

    Returns
    -------
    list of ProxyLobe
        At least one. Components that Mitsuba evaluates separately are fitted separately.

    Raises
    ------
    InputError
        If the BRDF is not finite at some of the directions.

    Notes
    -----
    Non-negative least squares (Lawson & Hanson 1974) of the relative error, weighted by energy (∫ err²/y), over
    directions drawn from lobes of all widths. Each channel is fitted separately: the highlight of a red paint is
    white, and proxies shared by the channels would put it into the diffuse lobe in green and blue.

    Examples
    --------
    >>> lobes = fit_lobes(mi.load_dict({"type": "roughconductor", "alpha": 0.1, "distribution": "ggx"}))
    >>> [round(lobe.alpha, 1) for lobe in lobes]
    [0.1]
    """
    probes = probe_directions()
    wi, wo, density = probes.wi, probes.wo, probes.density
    _check_finite(bsdf, wi, wo)
    components: list[int] | list[None] = told_apart(bsdf, wi, wo, density) or [None]
    matte = [c is not None and mi.has_flag(bsdf.flags(c), mi.BSDFFlags.Diffuse) for c in components]
    glossy = ROUGHNESSES if len(components) == 1 else ROUGHNESSES[1:]
    most = max(MOST_GLOSSY // max(matte.count(False), 1), 1)
    lobes = [
        replace(lobe, component=component)
        for component, is_matte in zip(components, matte, strict=True)
        for lobe in _fitted(reflected(bsdf, wi, wo, component), (LAMBERT,) if is_matte else glossy, most)
    ]
    return sorted(lobes, key=lambda lobe: (not lobe.is_matte, -lobe.alpha))


def _check_finite(bsdf: mi.BSDF, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> None:
    """Raise where the whole BRDF is NaN or infinite: neither a fit nor a bake can mend it."""
    bad = np.flatnonzero(~np.isfinite(reflected(bsdf, wi, wo)).all(axis=1))
    if bad.size:
        cosines = f"cos θ_i = {wi[bad[0], 2]:.3g}, cos θ_o = {wo[bad[0], 2]:.3g}"
        raise InputError(
            f"the BSDF is not finite at {bad.size} of {len(wi)} pairs of directions, first at {cosines}",
            where="material",
            fix="mend its eval, or its parameters",
        )


def _fitted(wanted: NDArray[np.float64], roughnesses: tuple[float, ...], most_glossy: int) -> list[ProxyLobe]:
    """Fit values at the probe directions by basis functions of some roughnesses."""
    probes = probe_directions()
    density = probes.density
    terms = [_columns(probes.wi, probes.wo, alpha) for alpha in roughnesses]
    basis = np.concatenate(terms, axis=1)
    weight = 1.0 / np.sqrt(density[:, None] * (wanted + 1e-3 * wanted.max(axis=0, initial=1e-12, keepdims=True) + 1e-6))
    solved = np.stack([nnls(basis * weight[:, c, None], wanted[:, c] * weight[:, c])[0] for c in range(3)], axis=1)
    ends = np.cumsum([part.shape[1] for part in terms])
    coefficients = np.split(solved, ends[:-1])
    energy = [float((part / density[:, None] @ c).sum()) for part, c in zip(terms, coefficients, strict=True)]
    return [
        ProxyLobe(tuple(roughnesses[i] for i in members), tuple(coefficients[i] for i in members))
        for members in _clusters(roughnesses, energy, most_glossy)
    ]


def _clusters(roughnesses: tuple[float, ...], energy: list[float], most_glossy: int) -> list[list[int]]:
    """Group the roughnesses that carry energy: one matte group, and at most `most_glossy` others."""
    total = sum(energy)
    if total <= 0:
        return [[0]]
    matte = [[i] for i, alpha in enumerate(roughnesses) if alpha == LAMBERT and energy[i] >= LEAST_SHARE * total]
    groups: list[list[int]] = []
    for i, alpha in enumerate(roughnesses):
        if alpha == LAMBERT or energy[i] <= 1e-6 * total:
            continue
        if groups and alpha < WIDEST_GAP * roughnesses[groups[-1][-1]]:
            groups[-1].append(i)
        else:
            groups.append([i])
    glossy = _merged(groups, np.log(np.maximum(roughnesses, _TINY)), energy, most_glossy)
    least, share = ALL_BUT_MATTE
    while matte and glossy and roughnesses[glossy[-1][0]] >= least and _carried(glossy[-1], energy) < share * total:
        matte[0] += glossy.pop()
    return [*matte, *reversed(glossy)] or [[0]]


def _carried(group: list[int], energy: list[float]) -> float:
    return sum(energy[i] for i in group)


def _merged(
    groups: list[list[int]], place: NDArray[np.float64], energy: list[float], most_glossy: int
) -> list[list[int]]:
    """Merge faint groups into their nearest neighbours, then nearest pairs until at most `most_glossy` remain."""
    least = LEAST_SHARE * sum(energy)

    def centre(group: list[int]) -> float:
        return float(np.average(place[group], weights=[energy[i] for i in group]))

    while len(groups) > 1:
        gaps = [centre(b) - centre(a) for a, b in pairwise(groups)]
        faintest = int(np.argmin([_carried(group, energy) for group in groups]))
        if _carried(groups[faintest], energy) < least:
            left = (
                faintest - 1
                if faintest == len(gaps) or (faintest > 0 and gaps[faintest - 1] < gaps[faintest])
                else faintest
            )
        elif len(groups) > most_glossy:
            left = int(np.argmin(gaps))
        else:
            break
        groups[left : left + 2] = [groups[left] + groups[left + 1]]
    return groups


def _columns(wi: NDArray[np.float64], wo: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    values = lobe_values(mi.Vector3f(wi.T.astype(np.float32)), mi.Vector3f(wo.T.astype(np.float32)), alpha)
    return np.stack([np.array(value, dtype=np.float64) for value in values], axis=1)
