"""A small trial of two ways to sample: what the light's samples are worth under an even sky."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.baking.integrator import EstimateOptions, SphereIntegrator
from rsibr.geometry.frame import view_frame

RESOLUTION = 24
BLOCKS = 16

MAX_SAMPLES = 256
"""Samples of a block at most; otherwise as many as the bake's blocks have, for their count decides what strata gain."""

_VIEW = (1.0, 2.0, 3.0)
_SEED = 0x70696C6F  # the letters "pilo": no view of a bake draws the same random numbers


def sampling_ratio(emitter: dict[str, Any], bsdf: mi.BSDF, samples: int) -> float:
    """Variance by the BSDF's samples alone, over that by light and BSDF together, at equal counts of samples.

    Parameters
    ----------
    emitter : dict
        Mitsuba emitter at infinity, an even one: a small source could escape the trial.
    bsdf : mi.BSDF
        The coating.
    samples : int
        Samples a texel in a block of the bake.

    Returns
    -------
    float
        Ratio of the relative variances, mean over the texels. The same on every machine, to rounding: a bake that is
        resumed decides alike. Standard error about 5 %.
    """
    count = min(samples, MAX_SAMPLES)
    alone, both = (
        _relative_variance(emitter, bsdf, count, EstimateOptions(light_samples=light)) for light in (False, True)
    )
    return alone / max(both, 1e-30)


def _relative_variance(emitter: dict[str, Any], bsdf: mi.BSDF, samples: int, options: EstimateOptions) -> float:
    integrator = SphereIntegrator(emitter, bsdf, RESOLUTION, options=options)
    frame = view_frame(np.array(_VIEW))
    seeds = (np.random.SeedSequence(_SEED, spawn_key=(k,)) for k in range(BLOCKS))
    blocks: NDArray[np.float64] = np.array([integrator.block(frame, samples, seed)[:, 0] for seed in seeds], np.float64)
    mean = blocks.mean(axis=0)
    return float((blocks.var(axis=0, ddof=1) / (mean**2 + (0.1 * mean.mean()) ** 2 + 1e-30)).mean())
