"""The error that a finished bake makes at new views, measured without path tracing: by the bake's own estimator."""

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
"""Samples a texel of the truth, and texels a side that they are for."""

_LEAST_SAMPLES = 64
_SEED_SHIFT = 1
"""Of the views that are judged: others than those that the choice went by."""


def reached_error(baked: Bake, scene: Scene) -> Estimate:
    """RelMSE of the method `rsibr` at views that took no part in any choice, the noise of the truth taken out.

    Parameters
    ----------
    baked : Bake
    scene : Scene
        What it was made from.

    Returns
    -------
    Estimate
        Mean over the views; its interval is over views like these.
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
