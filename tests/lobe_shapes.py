"""Shapes of lobes for tests, from the NumPy microfacets of `tests.microfacet`."""

from functools import cache

import numpy as np

from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.gaussians import Gaussians, LobeShape
from rsibr.lobes.probe_directions import probe_directions
from rsibr.lobes.shape_fit import fit_shape
from tests import microfacet

ONE = np.ones((1, 3))
NO_MATTE = np.zeros((2, 3))


def fitted(brdf, alpha, *, with_matte=False, colour=(1.0, 1.0, 1.0)):
    """Shape fitted to a BRDF times cosine, (wi, wo) → (n,)."""
    probes = probe_directions()
    return fit_shape(brdf(probes.wi, probes.wo)[:, None] * colour, alpha, with_matte=with_matte)


@cache
def ggx(alpha):
    """GGX without Fresnel term."""
    return fitted(lambda wi, wo: microfacet.ggx(wi, wo, alpha), alpha)


@cache
def fresnel(alpha):
    """GGX of a dielectric, by Schlick: 0.04 + 0.96 (1 − h·ω_o)⁵."""
    return fitted(lambda wi, wo: microfacet.dielectric(wi, wo, alpha), alpha)


@cache
def coated(alpha):
    """GGX under a coat."""
    return fitted(lambda wi, wo: microfacet.coated_ggx(wi, wo, alpha), alpha)


def matte(bare=(0.5, 0.2, 0.0), under_coat=(0.1, 0.0, 0.3)):
    return LobeShape(LAMBERT, Gaussians.none(), Gaussians.none(), np.array([bare, under_coat]))


def one_gaussian(sigma, alpha=None, *, under_coat=False):
    """One Gaussian, by default with the masking of a roughness as wide."""
    one = Gaussians(np.array([sigma]), ONE, 0 * ONE)
    pair = (Gaussians.none(), one) if under_coat else (one, Gaussians.none())
    return LobeShape(min(sigma, 1.0) if alpha is None else alpha, *pair, NO_MATTE)
