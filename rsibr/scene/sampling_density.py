"""Densities of BSDFs where they reflect nothing."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi


def reflects_nothing(value: mi.Spectrum) -> mi.Bool:
    """Whether a BSDF is exactly zero in every channel; with polarisation, for unpolarised light."""
    return dr.all(mi.unpolarized_spectrum(value) == 0)


def sound_density(value: mi.Spectrum, density: mi.Float) -> mi.Float:
    """Sampling density of a BSDF, 0 where it is NaN and the BSDF reflects nothing.

    A `roughplastic` whose specular reflectance is 0 chooses its component by 0/0 below the horizon. A NaN elsewhere is
    kept, so that it is noticed.

    Parameters
    ----------
    value : mi.Spectrum
        BSDF times cosine.
    density : mi.Float
        Density [sr⁻¹] from the same directions.
    """
    return dr.select(dr.isnan(density) & reflects_nothing(value), 0, density)
