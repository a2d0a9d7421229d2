"""Light scattered more than once between microfacets, as an addition to the diffuse albedo."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.albedo import NODES
from rsibr.methods.split_sum.material_fit import LobeFit

Array = NDArray[np.float64]

_MEAN_GRAZING = 1 / 21  # mean of (1 − cos θ)⁵ over the cosine lobe


def multiple_scattering(fits: Sequence[LobeFit], albedos: Sequence[Array]) -> Array:
    """Albedo of all scattering after the first, for each lobe, summed; shape (NODES, 3).

    Parameters
    ----------
    fits : sequence of LobeFit
        Glossy lobes.
    albedos : sequence of ndarray, shape (NODES, 3)
        Albedo of the first scattering of each.

    Notes
    -----
    Fdez-Agüera (2019), section 4: with E_ss = A + B the energy scattered once without a Fresnel term, F̄ = F₀ + (F₉₀ −
    F₀)/21 the mean reflectance and Fss E_ss the albedo, E_ms (Fss E_ss) F̄/(1 − F̄ E_ms) is reflected like a matte
    surface, E_ms = 1 − E_ss. A white lobe of GGX reflects all light then, as far as the fit has its
    reflectances: up to α = 0.3 within 1 %; a bake splits rougher ones into a glossy and a matte lobe, and a part
    stays lost.
    """
    total = np.zeros((NODES, 3))
    for fit, albedo in zip(fits, albedos, strict=True):
        lost = np.maximum(1 - fit.scattered_once, 0)[:, None]
        mean = np.clip(fit.f0 + (fit.f90 - fit.f0) * _MEAN_GRAZING, 0, 1)
        total = total + lost * albedo * mean / (1 - mean * lost)
    return total
