"""Wavelengths of a sample in spectral rendering, and its conversion to linear RGB.

In RGB variants there are no wavelengths and values pass unchanged, so that kernels are written once for all variants.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass(frozen=True)
class Wavelengths:
    """Four wavelengths of each sample, spaced by a quarter of the cumulative distribution.

    Attributes
    ----------
    nm : mi.Spectrum
        Wavelengths [nm]; empty in RGB.
    weight : mi.UnpolarizedSpectrum
        Inverse density of each; 1 in RGB.

    Notes
    -----
    Hero wavelength sampling: Wilkie et al. (2014). Density proportional to the observer's response: Radziszewski et al.
    (2009), as in Mitsuba's cameras.
    """

    nm: mi.Spectrum
    weight: mi.UnpolarizedSpectrum

    @classmethod
    def drawn(cls, uniform: Callable[[], mi.Float]) -> Wavelengths:
        """Sample wavelengths from one uniform number; in RGB `uniform` is not called."""
        if not mi.is_spectral:
            return cls(dr.zeros(mi.SurfaceInteraction3f).wavelengths, mi.UnpolarizedSpectrum(1))
        return cls.at(uniform())

    @classmethod
    def at(cls, u: mi.Float) -> Wavelengths:
        """Wavelengths at position `u` in [0, 1] of each quarter of the distribution; spectral variants only.

        The first wavelength is restricted to a quarter, because the other three repeat it a quarter apart: stratified
        `u` would otherwise lose its stratification.
        """
        return cls(*mi.sample_rgb_spectrum(mi.sample_shifted(0.25 * u)))

    def seen(self, radiance: mi.UnpolarizedSpectrum) -> mi.Color3f:
        """Convert weighted radiance to linear RGB.

        Parameters
        ----------
        radiance : mi.UnpolarizedSpectrum
            Radiance at `nm` [W sr⁻¹ m⁻² nm⁻¹], times `weight`; in RGB [W sr⁻¹ m⁻²].

        Returns
        -------
        mi.Color3f
            Linear Rec.709 by the CIE 1931 2° observer, as in Mitsuba's film: a unit spectrum has luminance 1. Negative
            for colours outside Rec.709, and for single samples of any colour.
        """
        return mi.spectrum_to_srgb(radiance, self.nm) if mi.is_spectral else radiance
