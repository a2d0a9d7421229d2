"""Evaluates a material by itself: any Mitsuba BSDF, in its own frame, one pair of directions a lane."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray


def interaction(wo: mi.Vector3f) -> mi.SurfaceInteraction3f:
    """Point of a surface whose normal is +z, seen from `wo`.

    Parameters
    ----------
    wo : mi.Vector3f
        Unit directions to the viewer in the surface's frame. Mitsuba calls this direction `wi`: it traces paths from
        the camera.
    """
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wo))
    si.t = 1.0
    si.n = mi.Normal3f(0, 0, 1)
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    si.wi = wo
    return si


def reflected(
    bsdf: mi.BSDF, wi: NDArray[np.float64], wo: NDArray[np.float64], flags: mi.BSDFFlags | None = None
) -> NDArray[np.float64]:
    """BRDF times cosine.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any BSDF.
    wi, wo : ndarray, shape (n, 3)
        Unit directions to the light and to the viewer in the surface's frame.
    flags : mi.BSDFFlags, optional
        Only the components of this kind; by default all.

    Returns
    -------
    ndarray, shape (n, 3)
        f(wi, wo) cos θ_i [sr⁻¹], Rec.709; delta components do not count.
    """
    context = mi.BSDFContext()
    if flags is not None:
        context.type_mask = int(flags)
    value = bsdf.eval(context, interaction(mi.Vector3f(wo.T.astype(np.float32))), mi.Vector3f(wi.T.astype(np.float32)))
    return np.array(value, dtype=np.float64).reshape(3, -1).T
