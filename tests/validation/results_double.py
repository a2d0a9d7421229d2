"""A small validation with known errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsibr.geometry.frame import view_frame
from rsibr.validation.estimate import Estimate
from rsibr.validation.flip import exposures_for
from rsibr.validation.lobes import LobeError, ViewLobes
from rsibr.validation.metrics import compare
from rsibr.validation.results import BakeSummary, MethodResult, Validation, ViewResult
from tests.validation.doubles import noisy_reference, smooth_map

_TITLES = {"diffuse": "diffuse under a coat", "coat": "clear coat, α 0.015"}


def small_validation(bake_seconds: float = 10.0, factors: dict[str, float] | None = None) -> Validation:
    """Two views of 32² texels; each method's map is the truth times its factor."""
    rng = np.random.default_rng(7)
    truth, exposures = smooth_map(), exposures_for(1.0)
    factors = factors or {"nearest": 1.4, "cabral1999": 1.05, "perfect": 1.0}
    views = []
    for index, view in enumerate([(0.0, 0.6, 0.8), (-1.0, 0.0, 0.0)]):
        reference = noisy_reference(truth, 0.01, rng)
        methods = {}
        for name, factor in factors.items():
            image = (truth * factor).astype(np.float32)
            methods[name] = MethodResult(image, compare(image, reference, exposures, name), 0.002 + 0.001 * index)
        views.append(ViewResult(view_frame(view), reference, methods, "random" if index else "triangle centroid"))
    bake = BakeSummary("paint.rsibr", "red <paint>", "city", 12, 32, 256, bake_seconds, 123456, {"Device": "llvm"})
    return Validation(bake, views, exposures)


def with_lobes(validation: Validation) -> Validation:
    """The same, with two lobes: `coat` is the worse at the first view, `diffuse` at the second."""
    views = []
    for index, view in enumerate(validation.views):
        half = 0.5 * view.reference.mean
        errors = {}
        for name, worse_at in (("diffuse", 1), ("coat", 0)):
            value = 2e-3 if index == worse_at else 1e-3
            flat = np.full(half.shape[:2], np.sqrt(value), np.float32)
            errors[name] = LobeError(half, half, Estimate(value, 1e-5, 7.0), 0.5, flat, _TITLES[name])
        views.append(replace(view, lobes=ViewLobes(errors, 64, 8, 1.5)))
    return replace(validation, views=views)
