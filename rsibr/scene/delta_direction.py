"""Test of a delta lobe: it must reflect about the surface's normal, and alike all over the surface."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.geometry.sphere_interaction import ON_THE_EQUATOR, interaction

_POINTS = 256
_DRAWS = 16  # random numbers that choose a component, for each point
_TURNED = 1e-3  # distance between the reflected and the mirror direction, far above rounding
_UNEVEN = 1e-3  # relative difference of the reflectance between two places
_SEED = 23


def require_plain_mirror(bsdf: mi.BSDF, name: str, where: str) -> None:
    """Refuse a delta lobe that no lookup in the mirror direction of the normal reproduces.

    Maps hold it as the environment in that direction, times a reflectance that depends on the view angle only. A bump
    or normal map that tilts the mirror, or a texture that colours it, would be lost without a word.

    Parameters
    ----------
    bsdf : mi.BSDF
        Any BSDF; without a delta component nothing is tested.
    name, where : str
        Name of the material, and the file or config key that an error names.

    Raises
    ------
    InputError
        If the lobe reflects into another direction, or differs from place to place or with the view's azimuth.
    """
    if not mi.has_flag(bsdf.flags(), mi.BSDFFlags.DeltaReflection):
        return
    rng = np.random.default_rng(_SEED)
    cosine, azimuth = rng.uniform(0.1, 1, _POINTS), rng.uniform(0, 2 * np.pi, _POINTS)
    place = np.stack([rng.uniform(0, 1, _POINTS), rng.uniform(0.05, 0.95, _POINTS)])
    fixed = np.tile(np.array(ON_THE_EQUATOR)[:, None], _POINTS)
    turned, here = _sampled(bsdf, cosine, azimuth, place)
    straight, there = _sampled(bsdf, cosine, np.zeros(_POINTS), fixed)
    if max(turned, straight) > _TURNED:
        raise InputError(
            f"'{name}' is a mirror that is tilted against the surface, and maps hold mirrors along its normal",
            where=where,
            fix="leave the bump or normal map away, or use a rough BSDF below it",
        )
    if (np.abs(here - there) > _UNEVEN * max(float(there.max(initial=0.0)), 1e-30)).any():
        raise InputError(
            f"'{name}' is a mirror that differs from place to place, and a sphere map holds one material",
            where=where,
            fix="use constant values",
        )


def _sampled(
    bsdf: mi.BSDF, cosine: NDArray[np.float64], azimuth: NDArray[np.float64], place: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """Largest distance from the mirror direction, and mean delta weight of each point, shape (channels, n)."""
    sine = np.sqrt(1 - cosine**2)
    wo = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])
    lanes = np.repeat(np.arange(cosine.size), _DRAWS)
    si = interaction(mi.Vector3f(wo[:, lanes].astype(np.float32)), uv=mi.Point2f(place[:, lanes].astype(np.float32)))
    u = np.tile((np.arange(_DRAWS) + 0.5) / _DRAWS, cosine.size).astype(np.float32)
    context = mi.BSDFContext()
    context.type_mask = int(mi.BSDFFlags.DeltaReflection)
    drawn, weight = bsdf.sample(context, si, mi.Float(u), mi.Point2f(0.5))
    is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.DeltaReflection) & (drawn.pdf > 0)
    distance = dr.select(is_delta, dr.norm(drawn.wo - mi.reflect(si.wi)), 0)
    weights = np.array(dr.select(is_delta, mi.unpolarized_spectrum(weight), 0), dtype=np.float64)
    whole = np.broadcast_to(weights.reshape(len(weights), -1), (len(weights), lanes.size))
    return float(dr.max(distance)[0]), whole.reshape(len(weights), cosine.size, _DRAWS).mean(axis=2)
