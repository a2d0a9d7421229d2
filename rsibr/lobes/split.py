"""Exact split of a material into lobes, each of which has a warp of its own.

f = Σ f·ω_k with shares ω_k = h_k / Σ h_j per colour channel, so that the lobes add up to f for any proxies h_k. If
Mitsuba evaluates the components f_c of a BSDF separately, ω_k = f_c/f · h_k / Σ h_j over the proxies of that component,
usually one.

In spectral rendering f_c/f is evaluated at each wavelength, and h_k / Σ h_j, which depends on directions only,
multiplies the RGB of each component. The split stays exact, because the shares add up to one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.sphere_interaction import interaction
from rsibr.lobes.albedo import albedo_tables, mirror_albedo
from rsibr.lobes.basis import LAMBERT, lobe_values
from rsibr.lobes.components import component_shares
from rsibr.lobes.fit import ProxyLobe, fit_lobes
from rsibr.lobes.gaussians import LobeShape
from rsibr.lobes.probe_directions import ProbeDirections, probe_directions
from rsibr.lobes.shape_fit import fit_shape
from rsibr.scene.wavelengths import Wavelengths

MIRROR = -1.0
"""Sentinel α for a delta lobe."""


@dataclass(frozen=True, eq=False)
class Lobe:
    """One lobe of a material.

    Attributes
    ----------
    name : str
        "diffuse", "mirror", or "glossy-" and its roughness; a repeated name is numbered.
    alpha : float
        Roughness α = r² of the fitted GGX lobe; `LAMBERT` for a matte lobe, `MIRROR` for a delta lobe.
    albedo : ndarray, shape (NODES, 3)
        Directional albedo E_k at the view angles of `rsibr.lobes.albedo.node_cosines`.
    shape : LobeShape
        The lobe itself as a sum of terms that can be gathered.
    proxy : ProxyLobe or None
        Fitted proxy; None for a delta lobe.
    """

    name: str
    alpha: float
    albedo: NDArray[np.float64]
    shape: LobeShape
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


class LobeSplit:  # numbers are opaque: materials with the same structure share kernels
    """Lobes of a material, and their shares in the BRDF at each pair of directions.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any isotropic BSDF.
    proxies : sequence of ProxyLobe
        Proxies, one a lobe; those with the same `component` share that component.
    lobes : list of Lobe, optional
        Lobes of a split of the same material, where they are known; computed at their first use otherwise.

    Attributes
    ----------
    names : list of str
        Unique names of all lobes.

    Examples
    --------
    >>> split = LobeSplit.of(mi.load_dict({"type": "conductor"}))
    >>> split.names, split.lobes[0].is_mirror
    (['mirror'], True)
    """

    def __init__(self, bsdf: mi.BSDF, proxies: Sequence[ProxyLobe], lobes: list[Lobe] | None = None) -> None:
        self._bsdf, self._proxies, self._known = bsdf, list(proxies), lobes
        self._terms = [_device_terms(proxy) for proxy in self._proxies]
        self._members: dict[int | None, list[int]] = {}
        for index, proxy in enumerate(self._proxies):
            self._members.setdefault(proxy.component, []).append(index)
        self._has_mirror = mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection)
        self.names = _distinct([*(_name(proxy) for proxy in self._proxies), *(["mirror"] if self._has_mirror else [])])

    @classmethod
    def of(cls, bsdf: mi.BSDF) -> LobeSplit:
        """Fit the proxies to the BSDF; see `rsibr.lobes.fit`. Beside a mirror, a smooth part that is black has none."""
        flags, kinds = bsdf.flags(), mi.BSDFFlags
        if not mi.has_flag(flags, kinds.Smooth):
            return cls(bsdf, [])
        proxies = fit_lobes(bsdf)
        is_black = not any(colours.any() for proxy in proxies for colours in proxy.coefficients)
        return cls(bsdf, [] if is_black and mi.has_flag(flags, kinds.DeltaReflection) else proxies)

    @property
    def proxies(self) -> tuple[ProxyLobe, ...]:
        """Proxies of the lobes that are not delta lobes."""
        return tuple(self._proxies)

    def of_variant(self, bsdf: mi.BSDF) -> LobeSplit:
        """Return the same split for the same material, loaded in the current variant of Mitsuba."""
        return LobeSplit(bsdf, self._proxies)

    @cached_property
    def lobes(self) -> list[Lobe]:
        """Lobes with their albedos and shapes, computed on first use in one to two seconds unless they are given."""
        if self._known is not None:
            return self._known
        tables = albedo_tables(self) if self._proxies else []
        smooth = zip(self.names, self._proxies, tables, self._shapes(), strict=False)
        lobes = [Lobe(name, proxy.alpha, table, shape, proxy) for name, proxy, table, shape in smooth]
        if not self._has_mirror:
            return lobes
        return [*lobes, Lobe(self.names[-1], MIRROR, mirror_albedo(self._bsdf), LobeShape.mirror())]

    def _shapes(self) -> list[LobeShape]:
        """Shape of each lobe that is not a delta lobe, fitted to f·ω_k."""
        return [
            fit_shape(values, proxy.alpha, with_matte=proxy.is_matte)
            for values, proxy in zip(self.values(probe_directions()), self._proxies, strict=True)
        ]

    def split(
        self,
        radiance: mi.UnpolarizedSpectrum,
        wi: mi.Vector3f,
        si: mi.SurfaceInteraction3f,
        is_delta: mi.Bool | bool,
        wavelengths: Wavelengths,
    ) -> list[mi.Color3f]:
        """Divide a sample of radiance among all lobes.

        Parameters
        ----------
        radiance : mi.UnpolarizedSpectrum
            Light from `wi` reflected toward the viewer [W sr⁻¹ m⁻²], times the weights of its wavelengths.
        wi : mi.Vector3f
            Unit directions to the light in the surface's frame.
        si : mi.SurfaceInteraction3f
            Points of the surface; `si.wi` is the direction to the viewer. See `rsibr.geometry.sphere_interaction`.
        is_delta : mi.Bool
            Whether it was reflected by a delta component.
        wavelengths : Wavelengths
            Wavelengths of the sample.

        Returns
        -------
        list of mi.Color3f
            Linear RGB of each of `lobes`; the sum is that of `radiance`.
        """
        if not self._proxies:
            return [wavelengths.seen(radiance)]
        smooth = dr.select(is_delta, 0, radiance) if self._has_mirror else radiance
        found = [mi.Color3f(0)] * len(self._proxies)
        for share, members in zip(self._component_shares(wi, si), self._members.values(), strict=True):
            # Zero radiance may come with an undefined direction: its shares are not evaluated. A NaN is kept
            seen = wavelengths.seen(dr.select(smooth == 0, 0, smooth * share))
            for member, part in zip(members, self._parts(members, wi, si.wi), strict=True):
                found[member] = dr.select(seen == 0, 0, seen * part)
        return [*found, wavelengths.seen(dr.select(is_delta, radiance, 0))] if self._has_mirror else found

    def parts(self, wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """BRDF times cosine [sr⁻¹] of each lobe that is not a delta lobe, in RGB rendering; see `shares`."""
        value = self._bsdf.eval(mi.BSDFContext(), interaction(wo), wi)
        return [value * share for share in self.shares(wi, wo)]

    def values(self, probes: ProbeDirections) -> list[NDArray[np.float64]]:
        """BRDF times cosine [sr⁻¹] of each lobe that is not a delta lobe at `probes`, each of shape (n, 3)."""
        if not self._proxies:
            return []
        wi, wo = (mi.Vector3f(np.ascontiguousarray(w.T, dtype=np.float32)) for w in (probes.wi, probes.wo))
        return [np.broadcast_to(np.array(part, dtype=np.float64).T, probes.wi.shape) for part in self.parts(wi, wo)]

    def shares(self, wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """Share ω_k of each lobe, in RGB rendering.

        Parameters
        ----------
        wi, wo : mi.Vector3f
            Unit directions to the light and to the viewer in the surface's frame.

        Returns
        -------
        list of mi.Color3f
            Non-negative, sum 1 in each channel. Where the BRDF is 0, the share of the first component is 1; where all
            proxies of a component are 0, that of its first proxy.
        """
        if not self._proxies:
            return []
        found = [mi.Color3f(0)] * len(self._proxies)
        for share, members in zip(self._component_shares(wi, interaction(wo)), self._members.values(), strict=True):
            for member, part in zip(members, self._parts(members, wi, wo), strict=True):
                found[member] = share * part
        return found

    def _component_shares(self, wi: mi.Vector3f, si: mi.SurfaceInteraction3f) -> list[mi.UnpolarizedSpectrum]:
        components = [component for component in self._members if component is not None]
        if len(components) < 2:
            return [mi.UnpolarizedSpectrum(1)]
        return component_shares(self._bsdf, components, wi, si)

    def _parts(self, members: list[int], wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """Shares of the proxies in their component; the first is one minus the others."""
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
    """Roughness on the host and on the device, and the non-zero coefficients of the basis functions."""
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
    """Number repeated names: layers of a map are identified by name."""
    counts = [names[: place + 1].count(name) for place, name in enumerate(names)]
    return [name if count == 1 else f"{name}-{count}" for name, count in zip(names, counts, strict=True)]
