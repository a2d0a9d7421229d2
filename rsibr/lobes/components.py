"""Components of a BSDF that Mitsuba can evaluate separately: an exact split into lobes, if available."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.bsdf_eval import only, reflected

LEAST_SHARE = 5e-3
"""Share of the reflected energy below which a component or cluster gets no lobe of its own."""

_ROUNDING = 1e-5
_TINY = 1e-30


def told_apart(
    bsdf: mi.BSDF, wi: NDArray[np.float64], wo: NDArray[np.float64], density: NDArray[np.float64]
) -> list[int]:
    """Smooth components of a BSDF that get a lobe each, if Mitsuba evaluates them separately.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any BSDF; delta components are ignored.
    wi, wo : ndarray, shape (n, 3)
        Unit directions to the light and to the viewer at which the BSDF is evaluated.
    density : ndarray, shape (n,)
        Density [sr⁻¹] with which the light directions were drawn.

    Returns
    -------
    list of int
        Indices for `mi.BSDFContext.component`; empty if the components do not add up to the BSDF: `principled` ignores
        the selected component.
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
    si: mi.SurfaceInteraction3f,
) -> list[mi.UnpolarizedSpectrum]:
    """Share f_i/f of each component in the BSDF.

    Parameters
    ----------
    bsdf : mi.BSDF
        The material.
    components : list of int
        From `told_apart`.
    wi : mi.Vector3f
        Unit directions to the light in the surface's frame.
    si : mi.SurfaceInteraction3f
        Points of the surface, seen from `si.wi`.

    Returns
    -------
    list of mi.UnpolarizedSpectrum
        Non-negative, sum 1 in each channel or at each wavelength. The first component is one minus the others, and 1
        where the BSDF is 0. With polarisation, shares for unpolarised incident light.
    """
    whole = mi.unpolarized_spectrum(bsdf.eval(mi.BSDFContext(), si, wi))
    others = []
    rest = mi.UnpolarizedSpectrum(1)
    for component in components[1:]:
        value = mi.unpolarized_spectrum(bsdf.eval(only(component), si, wi))
        share = dr.select(whole > _TINY, dr.minimum(value / dr.maximum(whole, _TINY), 1), 0)
        others.append(share)
        rest -= share
    return [dr.maximum(rest, 0), *others]
