"""Comparison of BSDF sampling with emitter and BSDF sampling (MIS), by a small trial."""

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
"""Maximum samples a block of the trial; below, those of the bake, because the gain of stratification depends on it."""

_VIEW = (1.0, 2.0, 3.0)
_SEED = 0x70696C6F  # the letters "pilo"; no random number is shared with a bake


def sampling_ratio(emitter: dict[str, Any], bsdf: mi.BSDF, samples: int) -> float:
    """Variance of BSDF sampling over that of emitter and BSDF sampling with MIS, at equal numbers of samples.

    Parameters
    ----------
    emitter : dict
        Mitsuba emitter at infinity, without small bright sources, which the trial could miss.
    bsdf : mi.BSDF
        BSDF of the coating.
    samples : int
        Samples a texel in a block of the bake.

    Returns
    -------
    float
        Ratio of the relative variances, each a mean over the texels, with a standard error of about 5 %. Deterministic
        up to rounding, so that a resumed bake makes the same decision. Texels whose samples are not finite are left
        out; 1 if there are no others.
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
    blocks = blocks[:, np.isfinite(blocks).all(axis=(0, 2))]
    if not blocks.size:
        return 1.0
    mean = blocks.mean(axis=0)
    return float((blocks.var(axis=0, ddof=1) / (mean**2 + (0.1 * mean.mean()) ** 2 + 1e-30)).mean())
