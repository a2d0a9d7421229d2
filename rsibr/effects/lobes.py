"""Splits a material, exactly, into lobes that are each warped in their own way.

f = Σ f·ω_k with ω_k = h_k / Σ h_j, per colour channel: whatever the stand-ins h_k are, the lobes add up to f.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.effects.albedo import albedo_tables, mirror_albedo
from rsibr.effects.fit import ProxyLobe, fit_lobes
from rsibr.effects.proxy import LAMBERT, ggx, lambert

MIRROR = -1.0
"""Stands where a roughness would for a delta distribution."""

_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class Lobe:
    """One lobe of a material: what a reconstruction has to know of it.

    Attributes
    ----------
    name : str
        "diffuse", "mirror", or "glossy" with its roughness.
    alpha : float
        Roughness α = r² of the microfacet lobe that it resembles; `LAMBERT` for a matte one, `MIRROR` for a delta.
    albedo : ndarray, shape (NODES, 3)
        Directional albedo E_k over the cosine of the viewing angle, at the nodes of `rsibr.effects.albedo`.
    """

    name: str
    alpha: float
    albedo: NDArray[np.float64]

    @property
    def is_mirror(self) -> bool:
        """Whether the lobe is a delta distribution."""
        return self.alpha == MIRROR

    @property
    def is_diffuse(self) -> bool:
        """Whether the lobe follows the normal rather than the mirror direction."""
        return self.alpha == LAMBERT


class LobeSplit:  # its numbers are opaque to kernels: another paint of the same build compiles nothing anew
    """The lobes of one material, and how each pair of directions is shared out among them.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any isotropic BSDF.
    proxies : sequence of ProxyLobe
        Stand-ins, one a lobe.
    """

    def __init__(self, bsdf: mi.BSDF, proxies: Sequence[ProxyLobe]) -> None:
        self._proxies = list(proxies)
        self._terms = [_device_terms(proxy) for proxy in self._proxies]
        tables = albedo_tables(bsdf, self) if self._proxies else []
        self.lobes = [
            Lobe(_name(proxy), _alpha(proxy), table) for proxy, table in zip(self._proxies, tables, strict=True)
        ]
        if mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection):
            self.lobes.append(Lobe("mirror", MIRROR, mirror_albedo(bsdf)))

    @classmethod
    def of(cls, bsdf: mi.BSDF) -> LobeSplit:
        """Fit the stand-ins to the BSDF; see `rsibr.effects.fit`."""
        return cls(bsdf, fit_lobes(bsdf) if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) else [])

    def split(
        self, radiance: mi.Color3f, wi: mi.Vector3f, wo: mi.Vector3f, is_delta: mi.Bool | bool
    ) -> list[mi.Color3f]:
        """Share a sample of radiance out among all lobes.

        Parameters
        ----------
        radiance : mi.Color3f
            Light from `wi` reflected toward `wo` [W sr⁻¹ m⁻²].
        wi, wo : mi.Vector3f
            Unit directions to the light and to the viewer in the surface's frame.
        is_delta : mi.Bool
            Whether a delta component reflected it.

        Returns
        -------
        list of mi.Color3f
            One for each of `lobes`; they add up to `radiance`.
        """
        if not self._proxies:
            return [radiance]
        has_mirror = len(self.lobes) > len(self._proxies)
        smooth = dr.select(is_delta, 0, radiance) if has_mirror else radiance
        # What carries no light may have no meaningful direction either; a NaN is no zero, and stays
        parts = [dr.select(smooth == 0, 0, smooth * share) for share in self.shares(wi, wo)]
        return [*parts, dr.select(is_delta, radiance, 0)] if has_mirror else parts

    def shares(self, wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """Share ω_k of each lobe.

        Parameters
        ----------
        wi, wo : mi.Vector3f
            Unit directions to the light and to the viewer in the surface's frame.

        Returns
        -------
        list of mi.Color3f
            Non-negative, sum 1 in each channel. Where no stand-in has anything, the widest lobe takes all.
        """
        values = [_value(terms, wi, wo) for terms in self._terms]
        total = mi.Color3f(0)
        for value in values:
            total += value
        scale = dr.select(total > _TINY, dr.rcp(dr.maximum(total, _TINY)), 0)
        narrow = [value * scale for value in values[1:]]
        rest = mi.Color3f(1)
        for share in narrow:
            rest -= share
        return [dr.maximum(rest, 0), *narrow]


def _device_terms(proxy: ProxyLobe) -> list[tuple[mi.Float | None, list[mi.Color3f]]]:
    """Roughness (None for a matte lobe) and coefficients of each proxy, on the device."""
    terms = []
    for alpha, coefficients in zip(proxy.alphas, proxy.coefficients, strict=True):
        colours = [mi.Color3f(*coefficient.tolist()) for coefficient in coefficients]
        roughness = None if alpha == LAMBERT else dr.opaque(mi.Float, alpha)
        dr.make_opaque(colours)
        terms.append((roughness, colours))
    return terms


def _value(terms: list[tuple[mi.Float | None, list[mi.Color3f]]], wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Color3f:
    value = mi.Color3f(0)
    for roughness, colours in terms:
        basis = (lambert(wi),) if roughness is None else ggx(wi, wo, roughness)
        for term, colour in zip(basis, colours, strict=True):
            value += term * colour
    return value


def _alpha(proxy: ProxyLobe) -> float:
    """Mean roughness of the proxies that make the lobe up, by the energy that each carries head-on."""
    if LAMBERT in proxy.alphas:
        return LAMBERT
    weights = [float(c[0].sum() + 0.05 * c[1].sum()) + _TINY for c in proxy.coefficients]
    return float(np.exp(np.average(np.log(proxy.alphas), weights=weights)))


def _name(proxy: ProxyLobe) -> str:
    alpha = _alpha(proxy)
    return "diffuse" if alpha == LAMBERT else f"glossy-{alpha:.3g}"
