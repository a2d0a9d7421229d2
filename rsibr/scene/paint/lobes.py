"""Lobes and refraction at a clear coat, in Dr.Jit; the normal is +z."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from rsibr.geometry import refraction


def ggx(alpha: float) -> mi.MicrofacetDistribution:
    """GGX distribution with opaque roughness, so that all roughnesses share a kernel."""
    return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, dr.opaque(mi.Float, alpha), True)


def microfacet_mirrors(facets: mi.MicrofacetDistribution, i: mi.Vector3f, o: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """BRDF [sr⁻¹] of perfectly reflecting microfacets, and the density [sr⁻¹] with which `mirrored` samples `o`."""
    facet = dr.normalize(i + o)
    value = facets.eval(facet) * facets.G(i, o, facet) / (4 * i.z * o.z)
    return value, facets.pdf(i, facet) / (4 * dr.dot(o, facet))


def mirrored(facets: mi.MicrofacetDistribution, i: mi.Vector3f, u: mi.Point2f) -> mi.Vector3f:
    """Sample a reflected direction from the microfacets visible from `i`."""
    facet, _ = facets.sample(i, u)
    return mi.reflect(i, facet)


def half_turn(w: mi.Vector3f) -> mi.Vector3f:
    """Rotate a direction by π about the normal: turns a mirror lobe into a retroreflective one."""
    return mi.Vector3f(-w.x, -w.y, w.z)


def refracted(w: mi.Vector3f, eta: mi.Float) -> mi.Vector3f:
    """Direction refracted into the coat, on the same side of the normal."""
    x, y, height_squared = refraction.refracted(w.x, w.y, eta)
    return mi.Vector3f(x, y, dr.safe_sqrt(height_squared))


def emerging(inner: mi.Vector3f, eta: mi.Float) -> mi.Vector3f:
    """Direction refracted out of the coat; downward in total internal reflection."""
    x, y, height_squared = refraction.emerging(inner.x, inner.y, eta)
    return mi.Vector3f(x, y, dr.select((height_squared > 0) & (inner.z > 0), dr.safe_sqrt(height_squared), -1))
