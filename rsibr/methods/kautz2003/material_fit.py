"""Parameters of the paper's reflection model fitted to a material: f_λ, k_d, k_s, and the width of the glossy lobe.

The model reflects (1 − F)·k_d·(diffuse) + F·k_s·(glossy) with F = f_λ + (1 − f_λ)(1 − cos θ)⁵; Kautz et al. (2003),
eq. 8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import over_disk
from rsibr.lobes.band_factors import exponent_for, phong
from rsibr.lobes.facet_moments import cosines
from rsibr.lobes.gaussians import LobeShape
from rsibr.lobes.microfacet import schlick
from rsibr.methods.glossy_factors import glossy_factors
from rsibr.methods.kautz2003.box_factors import bias_for
from rsibr.methods.lobe_terms import LobeTerms, albedo_at_nodes

Array = NDArray[np.float64]

_STEPS = 401  # values of f_λ that are tried
_TIE = 1e-9  # of f_λ, added to the squared error: the least of several that serve
_MATTE_EXPONENT = 1.0  # of the glossy lobe of a material that has none: a cosine lobe


@dataclass(frozen=True, eq=False)
class Lobes:
    """What the model is fitted to.

    Attributes
    ----------
    matte, glossy : ndarray, shape (NODES, 3)
        Directional albedo of all matte parts and of all others, at `rsibr.lobes.facet_moments.cosines`.
    factors : ndarray, shape (bands,)
        Band factors of the glossy lobes, see `glossy_factors`.
    """

    matte: Array
    glossy: Array
    factors: Array

    @classmethod
    def of(cls, shapes: Mapping[str, tuple[LobeShape, Array]]) -> Lobes:
        """Gather the lobes of a material, as in `MethodInputs.shapes`."""
        terms, nothing = LobeTerms.of(list(shapes.values())), np.zeros((len(cosines()), 3))
        mirrors = sum((albedo_at_nodes(albedo) for shape, albedo in shapes.values() if shape.is_mirror), start=nothing)
        matte = sum((term.share for term in terms.matte), start=nothing)
        glossy = sum((term.share for term in terms.gaussians), start=mirrors)
        factors = glossy_factors(terms, mirrors)
        return cls(matte, glossy, phong(_MATTE_EXPONENT) if factors is None else factors)


@dataclass(frozen=True, eq=False)
class KautzMaterial:
    """Parameters of the model, and how far it is from the material that it was fitted to.

    Attributes
    ----------
    f_lambda, k_d, k_s : ndarray, shape (3,)
        Schlick's reflectance at normal incidence, diffuse and glossy reflectance.
    bias : float
        Level of detail of the box-filtered cube, 0 for the finest level.
    exponent : float
        Exponent N of the Phong-filtered cube.
    albedo_error : float
        Root mean square error of the directional albedo over the disk of a map, relative to that of the albedo.
    split_error : float
        The same of its matte and its glossy part, each for itself, relative to the albedo.
    box_error, phong_error : float
        Relative error of the glossy lobe's band factors, box-filtered and Phong-filtered; see `band_factors.distance`.
    """

    f_lambda: Array
    k_d: Array
    k_s: Array
    bias: float
    exponent: float
    albedo_error: float
    split_error: float
    box_error: float
    phong_error: float

    @classmethod
    def fitted(cls, lobes: Lobes, size: int) -> KautzMaterial:
        """Fit the model to a material.

        Parameters
        ----------
        lobes : Lobes
            The material.
        size : int
            Texels a side of the cube's finest level.

        Notes
        -----
        f_λ, k_d and k_s by least squares over the disk of a map, in each channel: of the matte and the glossy part,
        which the contrast of the light shows apart, and of their sum, which its mean shows. Without matte parts k_d is
        0. Without glossy ones the sum alone counts: F hands to the glossy lobe, wide as the diffuse one, what it takes
        from that.
        """
        f, k_d, k_s = _reflectances(lobes.matte, lobes.glossy)
        bias, box_error = bias_for(lobes.factors, size)
        exponent, phong_error = exponent_for(lobes.factors)
        fresnel = schlick_mix(f)
        matte, glossy = (1 - fresnel) * k_d - lobes.matte, fresnel * k_s - lobes.glossy
        albedo = max(_rms(lobes.matte + lobes.glossy), 1e-30)
        split = float(np.hypot(_rms(matte), _rms(glossy))) / albedo
        return cls(f, k_d, k_s, bias, exponent, _rms(matte + glossy) / albedo, split, box_error, phong_error)


def schlick_mix(f_lambda: Array) -> Array:
    """F at the nodes, shape (NODES, 3) for f_λ of shape (3,); Schlick (1994), eq. 24."""
    graze = schlick(cosines(), np)[:, None]
    return np.asarray(f_lambda + (1 - f_lambda) * graze)


def _disk_mean(table: Array) -> Array:
    return over_disk(table, cosines())


def _rms(table: Array) -> float:
    return float(np.sqrt(_disk_mean(table**2).mean()))


def _reflectances(matte: Array, glossy: Array) -> tuple[Array, Array, Array]:
    """f_λ, k_d, k_s, each of shape (3,): the best of `_STEPS` values of f_λ, with k_d and k_s ≥ 0 solved for each."""
    f = np.linspace(0, 1, _STEPS)
    graze = schlick(cosines(), np)[:, None]
    through, back = 1 - (f + (1 - f) * graze), f + (1 - f) * graze  # (NODES, steps): 1 − F and F
    found = [_best(f, through, back, matte[:, c : c + 1], glossy[:, c : c + 1]) for c in range(3)]
    f_lambda, k_d, k_s = np.array(found).T
    return f_lambda, k_d, k_s


def _best(f: Array, through: Array, back: Array, matte: Array, glossy: Array) -> tuple[float, float, float]:
    """f_λ, k_d and k_s of one channel; `through` and `back` are 1 − F and F, shape (NODES, steps)."""
    both, apart = matte + glossy, float(glossy.any())  # the two parts count for themselves, or only their sum
    # Normal equations of apart·(|k_d(1−F) − M|² + |k_s F − G|²) + |k_d(1−F) + k_s F − (M+G)|²
    a, b, c = (1 + apart) * _disk_mean(through**2), _disk_mean(through * back), (1 + apart) * _disk_mean(back**2)
    p, q = _disk_mean(through * (apart * matte + both)), _disk_mean(back * (apart * glossy + both))
    det = np.maximum(a * c - b * b, 1e-12)
    k_d, k_s = (p * c - q * b) / det, (q * a - p * b) / det
    no_k_s, no_k_d = k_s < 0, (k_d < 0) | (not matte.any())
    k_d, k_s = np.where(no_k_s, p / np.maximum(a, 1e-12), k_d), np.where(no_k_d, q / np.maximum(c, 1e-12), k_s)
    k_d, k_s = np.where(no_k_d, 0, k_d), np.where(no_k_s, 0, k_s)
    error = _disk_mean((k_d * through + k_s * back - both) ** 2) + _TIE * f
    error += apart * _disk_mean((k_d * through - matte) ** 2 + (k_s * back - glossy) ** 2)
    best = int(np.argmin(error))
    return float(f[best]), float(k_d[best]), float(k_s[best])
