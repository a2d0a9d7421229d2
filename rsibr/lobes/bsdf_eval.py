"""Evaluation of a Mitsuba BSDF in its local frame, one pair of directions a lane."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.sphere_interaction import interaction

RETRO_RATIO = 1.5
"""Threshold of `retro_ratio` above which a material counts as retroreflective."""


def only(component: int) -> mi.BSDFContext:
    """BSDF context that selects one component."""
    context = mi.BSDFContext()
    context.component = component
    return context


def reflected(
    bsdf: mi.BSDF, wi: NDArray[np.float64], wo: NDArray[np.float64], component: int | None = None
) -> NDArray[np.float64]:
    """BRDF times cosine, on the host.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any BSDF.
    wi, wo : ndarray, shape (n, 3)
        Unit directions to the light and to the viewer in the surface's frame.
    component : int, optional
        Index of the only component to evaluate; by default all.

    Returns
    -------
    ndarray, shape (n, 3)
        f(wi, wo) cos θ_i [sr⁻¹], linear Rec.709, without delta components.
    """
    context = mi.BSDFContext() if component is None else only(component)
    value = bsdf.eval(context, interaction(mi.Vector3f(wo.T.astype(np.float32))), mi.Vector3f(wi.T.astype(np.float32)))
    found = np.array(value, dtype=np.float64).reshape(3, -1).T
    return np.broadcast_to(found, (len(wi), 3))  # a BSDF may return one lane for all


def retro_ratio(bsdf: mi.BSDF) -> float:
    """BRDF toward the light over that at the same polar angle and 90° azimuth, at 60°.

    The ratio is 1 for a Lambertian base, and both directions are far from the mirror direction of a glossy lobe, so
    that a larger ratio means retroreflection.
    """
    sine, cosine = np.sqrt(0.75), 0.5
    wo = np.array([[sine, 0.0, cosine]] * 2)
    back, side = reflected(bsdf, np.array([[sine, 0.0, cosine], [0.0, sine, cosine]]), wo).max(axis=1)
    return float(back / (side + 1e-6))
