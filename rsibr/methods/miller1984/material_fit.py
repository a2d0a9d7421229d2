"""Constants and weights of Miller & Hoffman (1984) fitted to a material: k_d, k_s, n, W_d, W_s.

The diffuse part is that of the material's lobes which follows the normal, the specular part the rest. The weights carry
the directional albedos, so that the light of a constant sky is reflected as it should be at every angle; the exponent
carries the width of the glossy lobes around the mirror direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import over_disk
from rsibr.lobes.band_factors import exponent_for
from rsibr.lobes.facet_moments import cosines
from rsibr.lobes.probe_directions import ProbeDirections, probe_directions
from rsibr.lobes.shape_fit import shape_values
from rsibr.methods.glossy_factors import glossy_factors
from rsibr.methods.lobe_terms import Lobe, LobeTerms, albedo_at_nodes, resampled
from rsibr.methods.miller1984.reflectance import VARNISH

Array = NDArray[np.float64]

_DRAWS = 512
_LEAST_MIRROR = 1e-6  # albedo of a mirror part that a glossy one is held against


@dataclass(frozen=True, eq=False)
class PhongMaterial:
    """A material in the terms of the paper.

    Attributes
    ----------
    k_d, k_s : ndarray, shape (3,)
        Constants of the diffuse and of the specular function. Zero where there is no such part.
    n : float
        Exponent of Phong's function; infinite for a perfect mirror, whose function has k_s = 1.
    mirror : float
        Mirror part of the specular function: 0, `VARNISH`, or 1 for a perfect mirror.
    w_d, w_s : ndarray, shape (NODES, 3)
        Weights by the cosine of the view angle, at `rsibr.lobes.facet_moments.cosines`.
    """

    k_d: Array
    k_s: Array
    n: float
    mirror: float
    w_d: Array
    w_s: Array


@dataclass(frozen=True, eq=False)
class MaterialFit:
    """Albedos of a material's diffuse, glossy and mirror parts, and the exponent that fits the glossy one.

    Attributes
    ----------
    diffuse, glossy, mirror : ndarray, shape (NODES, 3)
        Directional albedo of each part at `rsibr.lobes.facet_moments.cosines`.
    n : float
        Exponent of the Phong lobe whose band factors are nearest to those of the glossy lobes.
    lobes : sequence of (LobeShape, ndarray)
        The material's lobes, which the errors are measured against.
    """

    diffuse: Array
    glossy: Array
    mirror: Array
    n: float
    lobes: Sequence[Lobe]

    @classmethod
    def of(cls, lobes: Sequence[Lobe], n: float | None = None) -> MaterialFit:
        """Fit lobes: shape and directional albedo of each; `n`, if given, is taken as it is."""
        terms = LobeTerms.of(lobes)
        none = np.zeros((len(cosines()), 3))
        diffuse = sum((term.share for term in terms.matte), start=none)
        glossy = sum((term.share for term in terms.gaussians), start=none)
        mirror = sum((albedo_at_nodes(albedo) for shape, albedo in lobes if shape.is_mirror), start=none)
        factors = glossy_factors(terms) if n is None else None
        return cls(diffuse, glossy, mirror, (n or 1.0) if factors is None else exponent_for(factors)[0], lobes)

    def material(self) -> PhongMaterial:
        """Constants and weights whose table of a constant sky, times the weight, is the albedo at every angle.

        Notes
        -----
        Each weight has the mean 1 over the disk of a sphere map, so that the constants hold the colour. The table of a
        constant sky is k_d/4, and k_s/(2(n + 1)) + mirror part: hence k_d = 4 Ē_d and k_s = 2(n + 1) Ē_s. Under varnish
        the mirror part is given as ½, and k_s is set in proportion to it, k_s = (n + 1) Ē_glossy/Ē_mirror; the weight
        then holds the colour.
        """
        k_d = 4 * over_disk(self.diffuse, cosines())
        w_d = _over(self.diffuse, k_d / 4)
        if not self.mirror.any():
            k_s = 2 * (self.n + 1) * over_disk(self.glossy, cosines())
            return PhongMaterial(k_d, k_s, self.n, 0.0, w_d, _over(self.glossy, k_s / (2 * (self.n + 1))))
        if not self.glossy.any():
            return PhongMaterial(k_d, np.ones(3), np.inf, 1.0, w_d, self.mirror)
        mirrored = np.maximum(over_disk(self.mirror, cosines()), _LEAST_MIRROR)
        k_s = (self.n + 1) * over_disk(self.glossy, cosines()) / mirrored
        both = self.glossy + self.mirror
        return PhongMaterial(k_d, k_s, self.n, VARNISH, w_d, _over(both, k_s / (2 * (self.n + 1)) + VARNISH))

    @cached_property
    def errors(self) -> Array:
        """Relative error of the angular shape at each view angle of the probes, shape (angles,).

        ∫ |f̂ − f| dω over ∫ f dω, with f the material's BRDF times cosine, delta lobes excepted, and f̂ what the method
        has in its place: a Lambert and a Phong lobe of the same energies. Light that f̂ takes from below the horizon
        counts. Half of it is the share of the reflected light that comes from wrong directions.
        """
        probes = _probes()
        wanted = _values(self.lobes, glossy=True) + _values(self.lobes, glossy=False)
        diffuse, glossy = (_at(probes, part) for part in (self.diffuse, self.glossy))
        x = np.maximum(_mirrored(probes), 1e-9)
        found = diffuse * (np.maximum(probes.wi[:, 2], 0) / np.pi)[:, None]
        found = found + glossy * ((self.n + 1) / (2 * np.pi) * x**self.n)[:, None]
        return _shape_errors(found, wanted, diffuse + glossy, probes)

    @property
    def error(self) -> float:
        """Mean of `errors` over the disk of a sphere map."""
        weight = _disk_weights(_probes())
        return float((self.errors * weight).sum() / weight.sum())


def _probes() -> ProbeDirections:
    return probe_directions(draws=_DRAWS)


def _values(lobes: Sequence[Lobe], *, glossy: bool) -> Array:
    """BRDF times cosine of the glossy or of the matte parts of all lobes, scaled to their albedos, at the probes."""
    probes = _probes()
    total = np.zeros((len(probes.wi), 3))
    for shape, albedo in lobes:
        if shape.is_mirror:
            continue
        whole = shape_values(shape, probes)
        part = shape_values(replace(shape, matte=0 * shape.matte), probes)
        wanted, scale = _at(probes, albedo_at_nodes(albedo)), np.zeros_like(whole)
        for view in probes.views:
            scale[view] = wanted[view][:1] / np.maximum(_integral(whole, view, probes), 1e-30)
        total += (part if glossy else whole - part) * scale
    return total


def _shape_errors(found: Array, wanted: Array, energy: Array, probes: ProbeDirections) -> Array:
    errors = []
    for view in probes.views:
        below = np.maximum(energy[view][0] - _integral(found, view, probes), 0)
        off = _integral(np.abs(found - wanted), view, probes) + below
        errors.append(off.sum() / max(float(_integral(wanted, view, probes).sum()), 1e-30))
    return np.array(errors)


def _integral(values: Array, view: slice, probes: ProbeDirections) -> Array:
    """∫ values dω over the light's directions of one view; the draws of each density are `_DRAWS`."""
    return np.asarray((values[view] / probes.density[view, None]).sum(axis=0) / _DRAWS)


def _mirrored(probes: ProbeDirections) -> Array:
    """Cosine between the light and the mirror direction R of the viewer."""
    return np.asarray((probes.wi * probes.wo * np.array([-1.0, -1.0, 1.0])).sum(axis=1))


def _at(probes: ProbeDirections, table: Array) -> Array:
    """Values of a table by view angle at the probes, shape (n, 3)."""
    return resampled(table, cosines(), probes.wo[:, 2])


def _disk_weights(probes: ProbeDirections) -> Array:
    """Share of each view angle in the disk of a sphere map: that of the cosines nearest to its own."""
    own = np.array([probes.wo[view.start, 2] for view in probes.views])
    ascending = np.sort(own)
    edges = np.concatenate([[0.0], (ascending[:-1] + ascending[1:]) / 2, [1.0]])
    return np.asarray(np.diff(edges**2)[np.argsort(np.argsort(own))])


def _over(numerator: Array, denominator: Array) -> Array:
    """Quotient, zero where the denominator is."""
    return np.asarray(np.divide(numerator, denominator, out=np.zeros_like(numerator), where=denominator > 0))
