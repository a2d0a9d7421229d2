"""The components of a BSDF that Mitsuba evaluates one at a time: exact lobes, where a material has them."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.bsdf_eval import interaction, only, reflected

LEAST_SHARE = 5e-3
"""Share of the reflected energy below which nothing gets a lobe of its own."""

_ROUNDING = 1e-5
_TINY = 1e-30


def told_apart(
    bsdf: mi.BSDF, wi: NDArray[np.float64], wo: NDArray[np.float64], density: NDArray[np.float64]
) -> list[int]:
    """Smooth components of a BSDF that have a lobe each, where they can be had one at a time.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any BSDF; delta components do not take part.
    wi, wo : ndarray, shape (n, 3)
        Unit directions to the light and to the viewer at which it is probed.
    density : ndarray, shape (n,)
        Density [sr⁻¹] with which the light directions were drawn.

    Returns
    -------
    list of int
        Indices as `mi.BSDFContext.component` takes them; empty where they do not add up to the whole: `principled`
        answers with all of itself whichever component it is asked for.
    """
    whole = reflected(bsdf, wi, wo)
    parts = [reflected(bsdf, wi, wo, component) for component in range(bsdf.component_count())]
    excess = np.abs(np.sum(parts, axis=0) - whole)
    if (excess > _ROUNDING * whole + _TINY).any():
        return []
    energy = np.array([(part / density[:, None]).sum() for part in parts])
    return np.flatnonzero(energy >= LEAST_SHARE * max(float(energy.sum()), _TINY)).tolist()


def component_shares(
    bsdf: mi.BSDF,
    components: list[int],
    wi: mi.Vector3f,
    wo: mi.Vector3f,
    wavelengths: mi.Spectrum | None = None,
) -> list[mi.UnpolarizedSpectrum]:
    """Share f_i/f of each component in what a material reflects.

    Parameters
    ----------
    bsdf : mi.BSDF
        The material.
    components : list of int
        From `told_apart`.
    wi, wo : mi.Vector3f
        Unit directions to the light and to the viewer in the surface's frame.
    wavelengths : mi.Spectrum, optional
        Wavelengths [nm] of each lane, in spectral rendering.

    Returns
    -------
    list of mi.UnpolarizedSpectrum
        Non-negative, sum 1 in each channel, or at each wavelength: the first takes what the others leave, and all where
        nothing is reflected. With polarisation, shares of what unpolarised light becomes.
    """
    si = interaction(wo, wavelengths)
    whole = mi.unpolarized_spectrum(bsdf.eval(mi.BSDFContext(), si, wi))
    others = []
    rest = mi.UnpolarizedSpectrum(1)
    for component in components[1:]:
        value = mi.unpolarized_spectrum(bsdf.eval(only(component), si, wi))
        share = dr.select(whole > _TINY, dr.minimum(value / dr.maximum(whole, _TINY), 1), 0)
        others.append(share)
        rest -= share
    return [dr.maximum(rest, 0), *others]
