"""Surface interactions of the unit sphere, complete as if a ray had hit Mitsuba's `sphere` shape.

Position, normal, texture coordinates (u, v) = (φ / 2π, θ / π), their tangents, and the shading frame along ∂p/∂u. A
BSDF may read any of them: bump and normal maps, textures, anisotropic microfacets.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

ON_THE_EQUATOR = 0.5, 0.5
"""Texture coordinates of the point at which a material without a place is evaluated; far from the poles."""

_LEAST_SINE = 1e-6  # ∂p/∂u vanishes at the poles: no direction, and bump maps divide by its length


def sphere_interaction(
    n: mi.Vector3f, v: mi.Vector3f, wavelengths: mi.Spectrum | None = None
) -> mi.SurfaceInteraction3f:
    """Surface interaction at the point with normal `n`, in world coordinates.

    Parameters
    ----------
    n : mi.Vector3f
        Unit normals, which are also the points of the sphere.
    v : mi.Vector3f
        Unit directions to the viewer. Mitsuba, which traces paths from the camera, calls them `wi`.
    wavelengths : mi.Spectrum, optional
        Wavelengths [nm] of each lane, in spectral rendering.

    Returns
    -------
    mi.SurfaceInteraction3f
        As Mitsuba's `sphere` gives it, +z being its axis. At a pole, where ∂p/∂u vanishes, the frame is that of the
        meridian φ = 0, and ∂p/∂u has a length of 2π·1e-6.
    """
    # ---- Spherical coordinates; at the poles φ = 0 ----
    sine = dr.sqrt(n.x * n.x + n.y * n.y)
    at_pole = sine <= _LEAST_SINE
    scale = dr.rcp(dr.maximum(sine, _LEAST_SINE))
    cos_phi, sin_phi = dr.select(at_pole, 1, n.x * scale), dr.select(at_pole, 0, n.y * scale)
    phi = dr.atan2(sin_phi, cos_phi)
    uv = mi.Point2f(dr.select(phi < 0, phi + dr.two_pi, phi) * dr.inv_two_pi, dr.atan2(sine, n.z) * dr.inv_pi)
    # ---- Frame along the parallel and, with the right hand, to the pole +z ----
    s = mi.Vector3f(-sin_phi, cos_phi, 0)
    frame = mi.Frame3f(s, dr.cross(n, s), n)
    return _complete(frame, n, sine, uv, frame.to_local(v), wavelengths)


def interaction(
    wo: mi.Vector3f, wavelengths: mi.Spectrum | None = None, uv: mi.Point2f | None = None
) -> mi.SurfaceInteraction3f:
    """Surface interaction in the local frame: the sphere is turned so that the normal is +z and ∂p/∂u is along +x.

    Parameters
    ----------
    wo : mi.Vector3f
        Unit directions to the viewer in the surface's frame. Mitsuba, which traces paths from the camera, calls this
        direction `wi`.
    wavelengths : mi.Spectrum, optional
        Wavelengths [nm] of each lane, in spectral rendering.
    uv : mi.Point2f, optional
        Texture coordinates of the point; by default `ON_THE_EQUATOR`.
    """
    place = mi.Point2f(*ON_THE_EQUATOR) if uv is None else uv
    axes = [mi.Vector3f(*axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    return _complete(mi.Frame3f(*axes), axes[2], dr.sin(dr.pi * place.y), place, wo, wavelengths)


def _complete(
    frame: mi.Frame3f,
    p: mi.Vector3f,
    sine: mi.Float,
    uv: mi.Point2f,
    wi: mi.Vector3f,
    wavelengths: mi.Spectrum | None,
) -> mi.SurfaceInteraction3f:
    """Fill an interaction at the point `p`, whose distance from the axis is `sine`."""
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wi))
    if wavelengths is not None:
        si.wavelengths = wavelengths
    si.t = 1.0
    si.p, si.n, si.sh_frame = mi.Point3f(p), mi.Normal3f(frame.n), frame
    si.uv = uv
    si.dp_du = dr.two_pi * dr.maximum(sine, _LEAST_SINE) * frame.s
    si.dp_dv = -dr.pi * frame.t
    si.dn_du, si.dn_dv = mi.Vector3f(si.dp_du), mi.Vector3f(si.dp_dv)  # the normal of a unit sphere is its point
    si.wi = wi
    return si
