"""The wavelengths of a sample in spectral rendering, and what an observer sees of it.

In RGB there are none, and everything here hands its values through: kernels are written once for all renderings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass(frozen=True)
class Wavelengths:
    """Four wavelengths of each sample, a quarter of the distribution apart.

    Attributes
    ----------
    nm : mi.Spectrum
        Wavelengths [nm]; empty in RGB.
    weight : mi.UnpolarizedSpectrum
        Inverse density of each; 1 in RGB.

    Notes
    -----
    Hero wavelength sampling: Wilkie et al. (2014). The density follows what the observer sees: Radziszewski et al.
    (2009), as Mitsuba's cameras have it.
    """

    nm: mi.Spectrum
    weight: mi.UnpolarizedSpectrum

    @classmethod
    def drawn(cls, uniform: Callable[[], mi.Float]) -> Wavelengths:
        """Draw the first wavelength by a uniform number; in RGB none is asked for."""
        if not mi.is_spectral:
            return cls(dr.zeros(mi.SurfaceInteraction3f).wavelengths, mi.UnpolarizedSpectrum(1))
        return cls.at(uniform())

    @classmethod
    def at(cls, u: mi.Float) -> Wavelengths:
        """Wavelengths at a place 0 … 1 of each quarter of the distribution; in spectra only.

        A first wavelength drawn from all of it would come upon those of other samples, a quarter apart: strata wasted.
        """
        return cls(*mi.sample_rgb_spectrum(mi.sample_shifted(0.25 * u)))

    def seen(self, radiance: mi.UnpolarizedSpectrum) -> mi.Color3f:
        """What the observer sees of radiance that bears the weight already.

        Parameters
        ----------
        radiance : mi.UnpolarizedSpectrum
            A sample, times `weight`.

        Returns
        -------
        mi.Color3f
            Linear Rec.709 by the CIE 1931 2° observer, a unit spectrum having luminance 1, as Mitsuba's film has it.
            Below zero where a colour lies outside Rec.709, and for single samples of any colour.
        """
        return mi.spectrum_to_srgb(radiance, self.nm) if mi.is_spectral else radiance
