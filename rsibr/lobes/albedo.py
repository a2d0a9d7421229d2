"""Directional albedo of each lobe of a material, tabulated by view angle."""

from __future__ import annotations

from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.sphere_interaction import interaction
from rsibr.geometry.to_device import to_device
from rsibr.lobes.bsdf_eval import only
from rsibr.lobes.low_discrepancy import device_square
from rsibr.lobes.microfacet import ggx_density

NODES = 65
"""Entries of a table, uniform in √cos θ: densest at grazing angles, where albedos vary most."""

POINTS = 2**12
"""Directions of the light at each entry, for each sampling density."""

_WIDTHS = (0.005, 0.02, 0.08, 0.3)  # roughness α of the GGX lobes that are sampled besides the cosine lobe


class Lobed(Protocol):
    """Protocol of a material whose lobes can be evaluated."""

    def parts(self, wi: mi.Vector3f, wo: mi.Vector3f) -> list[mi.Color3f]:
        """BRDF times cosine of each lobe [sr⁻¹]."""


def node_cosines() -> NDArray[np.float64]:
    """Cosines of the view angle at the nodes, shape (NODES,), from grazing (slightly above 0) to normal incidence."""
    return np.maximum(np.linspace(0, 1, NODES) ** 2, 1e-5)


def albedo_tables(material: Lobed, points: int = POINTS) -> list[NDArray[np.float64]]:
    """E_k(cos θ_o) = ∫ f ω_k cos θ_i dω_i for each lobe.

    Parameters
    ----------
    material : Lobed
        Source of the lobes; delta lobes are not included.
    points : int
        Directions of the light at each angle and for each sampling density, a power of two.

    Returns
    -------
    list of ndarray, each of shape (NODES, 3)
        Albedos E_k in [0, 1], from grazing to normal incidence, one table a lobe.

    Notes
    -----
    Quasi-Monte Carlo with the same low-discrepancy points at every angle, drawn from a mixture of a cosine lobe and GGX
    lobes of several widths, with the MIS weights of the balance heuristic (Veach 1997, section 9.2). Lobes of every
    width are resolved, and the error varies smoothly with the angle.
    """
    lanes = dr.arange(mi.UInt32, NODES * points)
    cosine = dr.gather(mi.Float, to_device(mi.Float, node_cosines().astype(np.float32)), lanes // points)
    wo = mi.Vector3f(dr.sqrt(1 - cosine * cosine), 0, cosine)
    u = dr.gather(mi.Point2f, device_square(points), lanes % points)
    total = _albedos(material, wo, mi.warp.square_to_cosine_hemisphere(u), points)
    for width in _WIDTHS:  # opaque α: one kernel for all, as BSDFs compile slowly
        total = total + _albedos(material, wo, _around_mirror(u, wo, dr.opaque(mi.Float, width)), points)
    return list(total)


def _albedos(material: Lobed, wo: mi.Vector3f, wi: mi.Vector3f, points: int) -> NDArray[np.float64]:
    """Contribution to the albedos of directions `wi` drawn from one density, shape (lobes, NODES, 3)."""
    weight = dr.select(wi.z > 0, 1 / _density(wi, wo), 0)
    parts = [channel for part in material.parts(wi, wo) for channel in dr.select(weight > 0, part * weight, 0)]
    dr.eval(parts)
    sums = [np.array(dr.block_sum(channel, points), dtype=np.float64) / points for channel in parts]
    return np.stack(sums).reshape(-1, 3, NODES).swapaxes(1, 2)


def mirror_albedo(bsdf: mi.BSDF) -> NDArray[np.float64]:
    """Reflectance of the delta lobe by view angle in RGB rendering, shape (NODES, 3)."""
    values = np.array(delta_reflectance(bsdf), dtype=np.float64).reshape(3, -1).T
    return np.array(np.broadcast_to(values, (NODES, 3)))  # a BSDF may return one lane for all


def delta_reflectance(bsdf: mi.BSDF, wavelengths: mi.Spectrum | None = None) -> mi.UnpolarizedSpectrum:
    """Reflectance of all delta components together at the nodes; in spectral rendering at `wavelengths` [nm]."""
    cosines = mi.Float(node_cosines().astype(np.float32))
    wo = mi.Vector3f(dr.sqrt(dr.maximum(1 - cosines * cosines, 0)), 0, cosines)
    si = interaction(wo, wavelengths)
    total = mi.UnpolarizedSpectrum(0)
    for component in range(bsdf.component_count()):
        if mi.has_flag(bsdf.flags(component), mi.BSDFFlags.DeltaReflection):
            total += _delta_weight(bsdf, only(component), si)
    return total


def _delta_weight(bsdf: mi.BSDF, context: mi.BSDFContext, si: mi.SurfaceInteraction3f) -> mi.UnpolarizedSpectrum:
    """Weight of a sample of the delta component that a context selects: its reflectance, as nothing else is drawn."""
    context.type_mask = int(mi.BSDFFlags.DeltaReflection)
    drawn, weight = bsdf.sample(context, si, mi.Float(0.5), mi.Point2f(0.5))
    is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.DeltaReflection) & (drawn.pdf > 0)
    return dr.select(is_delta, mi.unpolarized_spectrum(weight), 0)


def _around_mirror(u: mi.Point2f, wo: mi.Vector3f, alpha: mi.Float) -> mi.Vector3f:
    tangent = alpha * dr.sqrt(u.x / dr.maximum(1 - u.x, 1e-7))
    cosine = dr.rsqrt(1 + tangent * tangent)
    sine, (s, c) = tangent * cosine, dr.sincos(2 * dr.pi * u.y)
    h = mi.Vector3f(sine * c, sine * s, cosine)
    return 2 * dr.dot(h, wo) * h - wo


def _density(wi: mi.Vector3f, wo: mi.Vector3f) -> mi.Float:
    """Sum of all sampling densities [sr⁻¹] at `wi`."""
    density = dr.maximum(wi.z, 0) * dr.inv_pi
    h = dr.normalize(wi + wo)
    for alpha in _WIDTHS:
        density += ggx_density(h.z, alpha) * dr.maximum(h.z, 0) / (4 * dr.maximum(dr.abs(dr.dot(h, wo)), 1e-6))
    return dr.maximum(density, 1e-20)


def over_disk(table: NDArray[np.float64], nodes: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Mean over the disk of a sphere map of a table by view angle: ∫ 2 cos θ E d cos θ.

    Parameters
    ----------
    table : ndarray, shape (N, …)
        Values by view angle.
    nodes : ndarray, shape (N,), optional
        Their cosines, ascending; by default `node_cosines`.
    """
    squares = (node_cosines() if nodes is None else nodes) ** 2
    return np.asarray(np.trapezoid(table, squares, axis=0) / (squares[-1] - squares[0]))
