"""Metamerism error: product of two RGB colours against the colour of the product of two spectra."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.sphere_interaction import interaction
from rsibr.scene.spectra import Samples, found_metals, found_spectra

_WHITE = 100.0
"""Luminance [cd/m²] of a white surface, at which colours are compared."""

_OBSERVER = "CIE 1931 2 Degree Standard Observer"
_RANGE = (360, 780)
"""Wavelengths [nm] that are summed over, in steps of 1 nm (ASTM E308)."""

_METAL_GRID = np.linspace(360.0, 830.0, 96)

_Pigment = tuple[str, Samples, NDArray[np.float64]]
"""Name, reflectance, and the colour that Mitsuba's RGB mode makes of it."""


@dataclass(frozen=True)
class Mismatch:
    """Pair of light and pigment with the largest colour error in RGB.

    Attributes
    ----------
    light, pigment : str
        Their names.
    difference : float
        ΔE_ITP (ITU-R BT.2124-0) with white at 100 cd/m²; 1 is just noticeable.
    rel_mse : float
        Squared difference over the squared colour, mean over the channels.
    """

    light: str
    pigment: str
    difference: float
    rel_mse: float


def rgb_mismatch(material: Mapping[str, Any] | Path | None, emitter: Mapping[str, Any] | None) -> Mismatch | None:
    """Compare spectral and RGB colours over all pairs of a given light and a given pigment.

    Parameters
    ----------
    material : mapping, Path or None
        BSDF as plain data, or Mitsuba XML.
    emitter : mapping or None
        Light as plain data. Without a spectrum, as for an image, it counts as daylight (D65).

    Returns
    -------
    Mismatch or None
        None if the material has no spectra: any spectrum of that colour is valid for an RGB pigment.

    Raises
    ------
    InputError
        If a spectrum is invalid.

    Notes
    -----
    The truth is ∫ S R x̄ dλ by colour-science; the other colour is the product of those that Mitsuba's RGB mode makes of
    S and of R. Both are taken over the luminance of a white surface under S.
    """
    spectra = found_spectra(material, "material")
    pigments: list[_Pigment] = [(name, samples, _rgb_of_pigment(samples)) for name, samples in spectra]
    pigments += [(name, *_metal(name)) for name in found_metals(material)]
    lights = {name: light for name, light in found_spectra(emitter, "environment") if any(value for _, value in light)}
    if not pigments:
        return None
    import colour  # noqa: PLC0415  # takes a second, and most scenes have no spectra

    under: list[tuple[str, Samples | None]] = [*lights.items()] or [("daylight (D65)", None)]
    found = [_mismatch(colour, light, pigment) for light in under for pigment in pigments]
    return max(found, key=lambda mismatch: mismatch.difference)


def _mismatch(colour: Any, light: tuple[str, Samples | None], pigment: _Pigment) -> Mismatch:
    shape = colour.SpectralShape(*_RANGE, 1)
    observer = colour.MSDS_CMFS[_OBSERVER].copy().align(shape)
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    illuminant = daylight if light[1] is None else _distribution(colour, light[1])
    truth = colour.sd_to_XYZ(_distribution(colour, pigment[1]), observer, illuminant) / 100
    light_rgb = np.ones(3) if light[1] is None else _rgb_of_light(light[1])
    product = pigment[2] * light_rgb / max(float(light_rgb @ [0.2126, 0.7152, 0.0722]), 1e-12)
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    rgb_truth = space.matrix_XYZ_to_RGB @ truth
    difference = colour.difference.delta_E_ITP(
        *(colour.XYZ_to_ICtCp(_WHITE * xyz) for xyz in (truth, space.matrix_RGB_to_XYZ @ product))
    )
    rel_mse = float(((product - rgb_truth) ** 2).mean() / max((rgb_truth**2).mean(), 1e-12))
    return Mismatch(light[0], pigment[0], float(difference), rel_mse)


def _distribution(colour: Any, samples: Samples) -> Any:
    """Samples on the wavelengths of `_RANGE`: linear between them, zero beyond, as in Mitsuba."""
    wavelengths = np.arange(_RANGE[0], _RANGE[1] + 1.0)
    given = np.array(samples, dtype=np.float64)
    values = np.interp(wavelengths, given[:, 0], given[:, 1], left=0, right=0)
    return colour.SpectralDistribution(values, wavelengths)


@cache  # a change of variant takes longer than all else here, and many materials are of few metals
def _metal(name: str) -> tuple[Samples, NDArray[np.float64]]:
    """Reflectance of a measured metal at normal incidence in Mitsuba's spectral and RGB modes."""
    with backend.rendering("spectral"):
        nm = mi.UnpolarizedSpectrum([mi.Float(row) for row in _METAL_GRID.reshape(4, -1).astype(np.float32)])
        values = np.array(_head_on(name, nm), dtype=np.float64).ravel()
    return list(zip(_METAL_GRID.tolist(), values.tolist(), strict=True)), np.array(_head_on(name)).ravel()


def _head_on(name: str, nm: mi.Spectrum | None = None) -> mi.UnpolarizedSpectrum:
    bsdf = backend.load({"type": "conductor", "material": name})
    si = interaction(mi.Vector3f(0, 0, 1), nm)
    return bsdf.sample(mi.BSDFContext(), si, mi.Float(0.5), mi.Point2f(0.5))[1]


def _rgb_of_pigment(samples: Samples) -> NDArray[np.float64]:
    bsdf = backend.load({"type": "diffuse", "reflectance": {"type": "spectrum", "value": samples}})
    head_on = mi.Vector3f(0, 0, 1)
    return np.pi * np.array(bsdf.eval(mi.BSDFContext(), interaction(head_on), head_on), dtype=np.float64).ravel()


def _rgb_of_light(samples: Samples) -> NDArray[np.float64]:
    light = backend.load({"type": "constant", "radiance": {"type": "spectrum", "value": samples}})
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    return np.array(light.eval(si), dtype=np.float64).ravel()
