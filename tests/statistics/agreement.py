"""Whether two bakes have the same mean: over all of their maps at once."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from rsibr.baking.blocks import MAX_BLOCKS
from rsibr.store.bake import Bake
from tests.statistics.comparison import compared, sidak


def agreement(a: Bake, b: Bake, freedom: float = MAX_BLOCKS - 1) -> float:
    """Corrected p-value of two tests: blocks of 4 × 4 texels, and each channel as a whole.

    Sums are held against the sums of their variances. Ratios of single texels are not looked at: a block of few samples
    is skewed, and so is a texel's mean over its own standard error, by more than the sum of thousands forgives.
    """
    one, two = ([bake.map(index) for index in range(bake.view_count)] for bake in (a, b))
    judged = np.concatenate([m.coverage > 0.5 for m in one])
    means = [np.concatenate([m.radiance for m in maps]) for maps in (one, two)]
    variances = [np.concatenate([m.variance for m in maps]).astype(np.float64) for maps in (one, two)]
    found = compared(means[0], variances[0], means[1], variances[1], judged, freedom)
    difference = (means[0].astype(np.float64) - means[1])[judged].sum(axis=0)
    rounding = (1e-6 * means[1][judged].sum(axis=0)) ** 2
    z = difference / np.sqrt(sum(v[judged].sum(axis=0) for v in variances) + rounding)
    return sidak(np.array([found.block, sidak(2 * norm.sf(np.abs(z)))]))
