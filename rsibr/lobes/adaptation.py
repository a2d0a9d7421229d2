"""Lobe albedos under the environment's spectrum, for maps that are rendered spectrally.

An albedo from RGB rendering holds under daylight. A spectrally rendered map holds the colour of the lobe's spectrum
times that of the light. Its RGB albedo is that colour over the colour of the light, with one mean spectrum for the
whole sky.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.backend import Rendering
from rsibr.geometry.sphere_interaction import interaction
from rsibr.geometry.to_device import to_device
from rsibr.lobes.albedo import albedo_tables, delta_reflectance, over_disk
from rsibr.lobes.low_discrepancy import device_square
from rsibr.lobes.split import Lobe, LobeSplit
from rsibr.scene.environment import Environment
from rsibr.scene.material import Material
from rsibr.scene.wavelengths import Wavelengths

Array = NDArray[np.float64]

_FINE = np.linspace(360.0, 830.0, 472)
"""Wavelengths [nm] at which the light is evaluated; fine, because lamps may have lines."""

_COARSE = np.linspace(360.0, 830.0, 64)
"""Wavelengths [nm] at which the material is evaluated; linear between them."""

_DIRECTIONS = 2**8
_POINTS = 2**10  # fewer than for an RGB table: common quadrature errors cancel in the ratio of two albedos
_LEAST = 1e-2  # share of the luminance below which a channel of the light is too dark to divide by
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_TINY = 1e-6


def adapted_lobes(
    split: LobeSplit, environment: Environment, material: Material, rendering: Rendering
) -> Sequence[Lobe]:
    """Lobes with the albedos that maps of the given rendering show.

    Parameters
    ----------
    split : LobeSplit
        Lobes of the material in RGB.
    environment, material
        Environment and material of the scene.
    rendering : {"rgb", "spectral", "spectral_polarized"}
        Rendering of the maps.

    Returns
    -------
    sequence of Lobe
        In RGB those of `split`. Otherwise with albedos and proxy coefficients under the mean spectrum of the light; in
        a channel where the light has almost no power, those of the luminance.
    """
    if rendering == "rgb" or environment.is_black:
        return split.lobes
    smooth = [lobe for lobe in split.lobes if not lobe.is_mirror]
    before = albedo_tables(split, _POINTS) if smooth else []
    with backend.rendering(rendering):
        bsdf = material.bsdf()
        seen = _InSpectra(bsdf, split.of_variant(bsdf), _response(environment.emitter()), len(smooth))
        after = albedo_tables(seen, _POINTS) if smooth else []
        mirrors = [seen.mirror_albedo() for lobe in split.lobes if lobe.is_mirror]
    adapted = [_adapted(*lobe) for lobe in zip(smooth, before, after, strict=True)]
    return [*adapted, *(replace(split.lobes[-1], albedo=table) for table in mirrors)]


@dataclass(frozen=True)
class _Observed(Wavelengths):
    """Four of the coarse wavelengths, and the response of each channel at them, normalised by the light's."""

    response: list[mi.UnpolarizedSpectrum]

    def seen(self, radiance: mi.UnpolarizedSpectrum) -> mi.Color3f:
        return mi.Color3f([dr.sum(row * radiance) for row in self.response])


@dataclass(frozen=True)
class _InSpectra:
    """Lobes of a material in linear RGB under one spectrum of light; input of `albedo_tables`.

    Attributes
    ----------
    bsdf : mi.BSDF
        The material in the current variant.
    split : LobeSplit
        Its lobes.
    response : ndarray, shape (4, wavelengths)
        The coarse wavelengths [nm], and the response of red, green and blue to reflected light at each.
    count : int
        Number of lobes that are not delta lobes.
    """

    bsdf: mi.BSDF
    split: LobeSplit
    response: Array
    count: int

    def parts(self, wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """BRDF times cosine [sr⁻¹] of each lobe that is not a delta lobe."""

        def seen(observed: _Observed) -> list[mi.Color3f]:
            si = interaction(wo, observed.nm)
            value = mi.unpolarized_spectrum(self.bsdf.eval(mi.BSDFContext(), si, wi))
            return self.split.split(value, wi, si, False, observed)[: self.count]

        return self._summed(seen, self.count)

    def mirror_albedo(self) -> Array:
        """Reflectance of the delta lobe by view angle, shape (NODES, 3)."""

        def seen(observed: _Observed) -> list[mi.Color3f]:
            return [observed.seen(delta_reflectance(self.bsdf, observed.nm))]

        return np.array(self._summed(seen, 1)[0], dtype=np.float64).T

    def _summed(self, seen: Callable[[_Observed], list[mi.Color3f]], count: int) -> list[mi.Color3f]:
        """Sum of `seen` over all wavelengths, four at a time."""
        table = [to_device(mi.Float, row.astype(np.float32)) for row in self.response]

        def body(place: mi.UInt32, total: list[mi.Color3f]) -> tuple[mi.UInt32, list[mi.Color3f]]:
            fours = [
                mi.UnpolarizedSpectrum([dr.gather(mi.Float, row, 4 * place + k) for k in range(4)]) for row in table
            ]
            found = seen(_Observed(fours[0], mi.UnpolarizedSpectrum(1), fours[1:]))
            return place + 1, [a + b for a, b in zip(total, found, strict=True)]

        state = mi.UInt32(0), [mi.Color3f(0) for _ in range(count)]
        sets = len(_COARSE) // 4
        _, total = dr.while_loop(state, lambda place, _total: place < sets, body, label="wavelengths")
        return list(total)


def _adapted(lobe: Lobe, before: Array, after: Array) -> Lobe:
    """Scale a lobe's albedo table by after/before, its shape and its proxy's coefficients by the mean of that ratio."""
    factor = np.where(before > _TINY, np.maximum(after, 0) / np.maximum(before, _TINY), 1.0)
    albedo = lobe.albedo * factor
    tint = over_disk(albedo) / np.maximum(over_disk(lobe.albedo), _TINY)
    if lobe.proxy is None:
        return replace(lobe, albedo=albedo)
    coefficients = tuple(colours * tint for colours in lobe.proxy.coefficients)
    proxy = replace(lobe.proxy, coefficients=coefficients)
    return replace(lobe, albedo=albedo, shape=lobe.shape.tinted(tint), proxy=proxy)


def _response(emitter: dict[str, Any]) -> Array:
    """Coarse wavelengths [nm], and the response of each channel to light reflected at them; shape (4, 64).

    Light times observer, integrated against the hat functions of a linear interpolation; each channel sums to one.
    """
    observer = np.array(mi.xyz_to_srgb(mi.cie1931_xyz(to_device(mi.Float, _FINE.astype(np.float32)))), dtype=np.float64)
    hats = np.stack([np.interp(_FINE, _COARSE, row) for row in np.eye(len(_COARSE))], axis=1)
    rows = (observer * _mean_spectrum(emitter)) @ hats
    luminance = _LUMINANCE @ rows
    usable = rows.sum(axis=1) > _LEAST * luminance.sum()
    rows = np.where(usable[:, None], rows, luminance)
    return np.vstack([_COARSE, rows / rows.sum(axis=1, keepdims=True)])


def _mean_spectrum(emitter: dict[str, Any]) -> Array:
    """Mean spectrum of the light over all directions at the fine wavelengths, up to a factor."""
    scene = backend.load({"type": "scene", "light": emitter})
    sets = len(_FINE) // 4
    lanes = dr.arange(mi.UInt32, sets * _DIRECTIONS)
    nm = to_device(mi.Float, _FINE.astype(np.float32))
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(lanes))
    si.wavelengths = mi.UnpolarizedSpectrum([dr.gather(mi.Float, nm, lanes // _DIRECTIONS * 4 + k) for k in range(4)])
    u = dr.gather(mi.Point2f, device_square(_DIRECTIONS), lanes % _DIRECTIONS)
    _, weight = scene.sample_emitter_direction(si, u, test_visibility=False)
    radiance = mi.unpolarized_spectrum(weight)
    means = [np.array(dr.block_sum(channel + dr.zeros(mi.Float, dr.width(lanes)), _DIRECTIONS)) for channel in radiance]
    return np.stack(means, axis=1).ravel().astype(np.float64)
