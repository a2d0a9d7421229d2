"""Pairs of directions at which a BRDF is probed for a fit, and the density that they were drawn with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rsibr.lobes.low_discrepancy import sobol
from rsibr.lobes.microfacet import ggx_density

Array = NDArray[np.float64]

COSINES_OUT = (0.98, 0.8, 0.6, 0.4, 0.25, 0.12)
"""Cosines of the view angles."""

DRAWS = 128
"""Light directions at each view angle and from each density."""

_WIDTHS = (0.004, 0.02, 0.07, 0.25, 0.7)  # roughness α of the GGX lobes that are drawn from besides the cosine lobe
_SEED = 7


@dataclass(frozen=True, eq=False)
class ProbeDirections:
    """Pairs of directions in the surface's frame.

    Attributes
    ----------
    wi, wo : ndarray, shape (n, 3)
        Unit directions to the light, above the surface, and to the viewer.
    density : ndarray, shape (n,)
        Sum of the densities [sr⁻¹] that light directions were drawn with; a mean over the draws of one density of
        values over `density` is an integral over the light.
    """

    wi: Array
    wo: Array
    density: Array

    @property
    def views(self) -> list[slice]:
        """Rows of each view angle, in the order of the angles."""
        starts = np.flatnonzero(np.diff(self.wo[:, 2], prepend=np.nan) != 0)
        return [slice(a, b) for a, b in zip(starts, [*starts[1:], len(self.wo)], strict=True)]


@cache
def probe_directions(
    cosines: tuple[float, ...] = COSINES_OUT, draws: int = DRAWS, seed: int = _SEED
) -> ProbeDirections:
    """Draw light directions from lobes of all widths around the mirror direction of each view, and from a cosine lobe.

    Parameters
    ----------
    cosines : tuple of float
        Cosines of the view angles.
    draws : int
        Directions at each angle and from each density, a power of two.
    seed : int
        Of the scrambled Sobol points, the same at every angle.

    Examples
    --------
    >>> probes = probe_directions()
    >>> bool((probes.wi[:, 2] > 0).all())
    True
    """
    u = sobol(2, draws, seed=seed)
    lights, views = [], []
    for cosine in cosines:
        out = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
        lights += [_mirrored(_ggx_normals(u, alpha), out) for alpha in _WIDTHS]
        radius, turn = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
        lights.append(np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - u[:, 0])], axis=1))
        views.append(np.tile(out, ((len(_WIDTHS) + 1) * draws, 1)))
    wi, wo = np.concatenate(lights), np.concatenate(views)
    above = wi[:, 2] > 1e-3
    return ProbeDirections(wi[above], wo[above], _density(wi[above], wo[above]))


def _ggx_normals(u: Array, alpha: float) -> Array:
    tangent = alpha * np.sqrt(u[:, 0] / (1 - u[:, 0]))
    cosine = 1 / np.sqrt(1 + tangent**2)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(2 * np.pi * u[:, 1]), sine * np.sin(2 * np.pi * u[:, 1]), cosine], axis=1)


def _mirrored(h: Array, wo: Array) -> Array:
    return np.asarray(2 * (h @ wo)[:, None] * h - wo)


def _density(wi: Array, wo: Array) -> Array:
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    density = np.maximum(wi[:, 2], 0) / np.pi
    for alpha in _WIDTHS:
        density = density + ggx_density(h[:, 2], alpha) * h[:, 2] / (4 * np.maximum((h * wo).sum(1), 1e-6))
    return np.asarray(density)
