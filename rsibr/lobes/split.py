"""Splits a material, exactly, into lobes that are each warped in their own way.

f = Σ f·ω_k with ω_k = h_k / Σ h_j, per colour channel: whatever the stand-ins h_k are, the lobes add up to f. Where
Mitsuba tells the components of a BSDF apart, each component f_c takes its own share instead: ω_k = f_c/f · h_k / Σ h_j
over the stand-ins of that component, most often only one.

In spectral rendering f_c/f is taken wavelength by wavelength, and h_k / Σ h_j, which knows only directions, from the
colour that an observer sees of each component: as exact, for the weights still add up to one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import albedo_tables, mirror_albedo
from rsibr.lobes.basis import LAMBERT, lobe_values
from rsibr.lobes.bsdf_eval import interaction
from rsibr.lobes.components import component_shares
from rsibr.lobes.fit import ProxyLobe, fit_lobes
from rsibr.scene.wavelengths import Wavelengths

MIRROR = -1.0
"""Stands where a roughness would for a delta distribution."""


@dataclass(frozen=True, eq=False)
class Lobe:
    """One lobe of a material: what a reconstruction has to know of it.

    Attributes
    ----------
    name : str
        "diffuse", "mirror", or "glossy" with its roughness; with a number behind it where one comes again.
    alpha : float
        Roughness α = r² of the microfacet lobe that it resembles; `LAMBERT` for a matte one, `MIRROR` for a delta.
    albedo : ndarray, shape (NODES, 3)
        Directional albedo E_k over the cosine of the viewing angle, at the nodes of `rsibr.lobes.albedo`.
    proxy : ProxyLobe or None
        What stands in for it; None for a delta.
    """

    name: str
    alpha: float
    albedo: NDArray[np.float64]
    proxy: ProxyLobe | None = None

    @property
    def is_mirror(self) -> bool:
        """Whether the lobe is a delta distribution."""
        return self.alpha == MIRROR

    @property
    def is_diffuse(self) -> bool:
        """Whether the lobe follows the normal rather than the mirror direction."""
        return self.alpha == LAMBERT


_TINY = 1e-12


class LobeSplit:  # its numbers are opaque to kernels: another paint of the same build compiles nothing anew
    """The lobes of one material, and how each pair of directions is shared out among them.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any isotropic BSDF.
    proxies : sequence of ProxyLobe
        Stand-ins, one a lobe, those of one component together counted as what that component is made of.

    Attributes
    ----------
    names : list of str
        Names of all lobes, each once.
    """

    def __init__(self, bsdf: mi.BSDF, proxies: Sequence[ProxyLobe]) -> None:
        self._bsdf, self._proxies = bsdf, list(proxies)
        self._terms = [_device_terms(proxy) for proxy in self._proxies]
        self._members: dict[int | None, list[int]] = {}
        for index, proxy in enumerate(self._proxies):
            self._members.setdefault(proxy.component, []).append(index)
        self._has_mirror = mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection)
        self.names = _distinct([*(_name(proxy) for proxy in self._proxies), *(["mirror"] if self._has_mirror else [])])

    @classmethod
    def of(cls, bsdf: mi.BSDF) -> LobeSplit:
        """Fit the stand-ins to the BSDF; see `rsibr.lobes.fit`."""
        return cls(bsdf, fit_lobes(bsdf) if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) else [])

    def of_variant(self, bsdf: mi.BSDF) -> LobeSplit:
        """Return the same split for the same material as the current variant of Mitsuba has loaded it."""
        return LobeSplit(bsdf, self._proxies)

    @cached_property
    def lobes(self) -> list[Lobe]:
        """The lobes with their albedos, which take a second or two."""
        tables = albedo_tables(self) if self._proxies else []
        smooth = zip(self.names, self._proxies, tables, strict=False)
        lobes = [Lobe(name, proxy.alpha, table, proxy) for name, proxy, table in smooth]
        return [*lobes, Lobe(self.names[-1], MIRROR, mirror_albedo(self._bsdf))] if self._has_mirror else lobes

    def split(
        self,
        radiance: mi.UnpolarizedSpectrum,
        wi: mi.Vector3f,
        wo: mi.Vector3f,
        is_delta: mi.Bool | bool,
        wavelengths: Wavelengths,
    ) -> list[mi.Color3f]:
        """Share a sample of radiance out among all lobes.

        Parameters
        ----------
        radiance : mi.UnpolarizedSpectrum
            Light from `wi` reflected toward `wo` [W sr⁻¹ m⁻²], times the weight of its wavelengths.
        wi, wo : mi.Vector3f
            Unit directions to the light and to the viewer in the surface's frame.
        is_delta : mi.Bool
            Whether a delta component reflected it.
        wavelengths : Wavelengths
            Of the sample.

        Returns
        -------
        list of mi.Color3f
            One for each of `lobes`, as an observer sees them; they add up to `radiance`.
        """
        if not self._proxies:
            return [wavelengths.seen(radiance)]
        smooth = dr.select(is_delta, 0, radiance) if self._has_mirror else radiance
        found = [mi.Color3f(0)] * len(self._proxies)
        for share, members in zip(self._component_shares(wi, wo, wavelengths.nm), self._members.values(), strict=True):
            # What carries no light may have no meaningful direction either; a NaN is no zero, and stays
            seen = wavelengths.seen(dr.select(smooth == 0, 0, smooth * share))
            for member, part in zip(members, self._parts(members, wi, wo), strict=True):
                found[member] = dr.select(seen == 0, 0, seen * part)
        return [*found, wavelengths.seen(dr.select(is_delta, radiance, 0))] if self._has_mirror else found

    def parts(self, wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """BRDF times cosine [sr⁻¹] of each lobe that is no delta, in RGB rendering; see `shares`."""
        value = self._bsdf.eval(mi.BSDFContext(), interaction(wo), wi)
        return [value * share for share in self.shares(wi, wo)]

    def shares(self, wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """Share ω_k of each lobe, in RGB rendering.

        Parameters
        ----------
        wi, wo : mi.Vector3f
            Unit directions to the light and to the viewer in the surface's frame.

        Returns
        -------
        list of mi.Color3f
            Non-negative, sum 1 in each channel. Where nothing is reflected, the first component takes all; where no
            stand-in of a component has anything, the first of them.
        """
        found = [mi.Color3f(0)] * len(self._proxies)
        for share, members in zip(self._component_shares(wi, wo), self._members.values(), strict=True):
            for member, part in zip(members, self._parts(members, wi, wo), strict=True):
                found[member] = share * part
        return found

    def _component_shares(
        self, wi: mi.Vector3f, wo: mi.Vector3f, nm: mi.Spectrum | None = None
    ) -> list[mi.UnpolarizedSpectrum]:
        components = [component for component in self._members if component is not None]
        if len(components) < 2:
            return [mi.UnpolarizedSpectrum(1)]
        return component_shares(self._bsdf, components, wi, wo, nm)

    def _parts(self, members: list[int], wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """Shares of a component's stand-ins among themselves: the first takes what the others leave."""
        if len(members) == 1:
            return [mi.Color3f(1)]
        values = [_value(self._terms[member], wi, wo) for member in members]
        total = mi.Color3f(0)
        for value in values:
            total += value
        scale = dr.select(total > _TINY, dr.rcp(dr.maximum(total, _TINY)), 0)
        others = [value * scale for value in values[1:]]
        rest = mi.Color3f(1)
        for share in others:
            rest -= share
        return [dr.maximum(rest, 0), *others]


_Term = tuple[float, "mi.Float", dict[int, "mi.Color3f"]]


def _device_terms(proxy: ProxyLobe) -> list[_Term]:
    """Roughness, on the host and on the device, and the colours of the basis functions that are not black."""
    terms = []
    for alpha, coefficients in zip(proxy.alphas, proxy.coefficients, strict=True):
        colours = {i: mi.Color3f(*colour.tolist()) for i, colour in enumerate(coefficients) if colour.any()}
        dr.make_opaque(colours)
        terms.append((alpha, dr.opaque(mi.Float, alpha), colours))
    return terms


def _value(terms: list[_Term], wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Color3f:
    value = mi.Color3f(0)
    for alpha, roughness, colours in terms:
        basis = lobe_values(wi, wo, alpha, roughness)
        for i, colour in colours.items():
            value += basis[i] * colour
    return value


def _name(proxy: ProxyLobe) -> str:
    return "diffuse" if proxy.is_matte else f"glossy-{proxy.alpha:.3g}"


def _distinct(names: list[str]) -> list[str]:
    """Number the names that come again: a layer of a map is known by its name."""
    counts = [names[: place + 1].count(name) for place, name in enumerate(names)]
    return [name if count == 1 else f"{name}-{count}" for name, count in zip(names, counts, strict=True)]
