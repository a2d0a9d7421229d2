"""Error of a finished bake at novel views, measured with the bake's own estimator instead of path tracing."""

from __future__ import annotations

import math

import numpy as np

from rsibr.baking.scene import Scene
from rsibr.budget.probe import ProbedScene, new_views
from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import default_method
from rsibr.store.bake import Bake
from rsibr.store.noise import COVERED, denominator
from rsibr.validation.estimate import Estimate

VIEWS = 8

_SAMPLES = 1024
_COARSE = 64
"""Samples a texel of the reference, at this number of texels a side."""

_LEAST_SAMPLES = 64
_SEED_SHIFT = 1
"""Offset of the seed of the views, so that they differ from those of the probes."""


def reached_error(baked: Bake, scene: Scene) -> Estimate:
    """RelMSE of the method `rsibr` at views that the probes did not use, with the noise of the reference subtracted.

    Parameters
    ----------
    baked : Bake
        Finished bake.
    scene : Scene
        Scene of the bake.

    Returns
    -------
    Estimate
        Mean over the views; its interval is that of the mean over a population of such views.
    """
    probed = ProbedScene(scene)
    viewpoints = Viewpoints(baked.directions, baked.triangles)
    method = MethodSet(baked)[default_method()]
    integrator = probed.integrator.at_resolution(baked.resolution)
    judged = integrator.coverage >= COVERED
    samples = max(_LEAST_SAMPLES, _SAMPLES * _COARSE**2 // baked.resolution**2)
    errors = []
    for view in new_views(viewpoints, scene.config.sampling.seed + _SEED_SHIFT, VIEWS):
        frame = view_frame(view)
        true = probed.map(integrator, frame, samples)
        truth = true.radiance[judged].astype(np.float64)
        noise = np.zeros_like(truth) if true.variance is None else true.variance[judged]
        picture = run(method, frame, baked.resolution).image[judged]
        errors.append(float((((picture - truth) ** 2 - noise) / denominator(truth)).mean()))
    return Estimate(float(np.mean(errors)), float(np.std(errors, ddof=1)) / math.sqrt(VIEWS), VIEWS - 1)
