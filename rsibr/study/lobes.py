"""Which lobe errs most: each lobe's picture against the truth of that lobe alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rsibr.bake.integrator import SphereIntegrator
from rsibr.effects.lobes import LobeSplit
from rsibr.reconstruct.lobed import LobedMethod
from rsibr.reconstruct.reconstruction import run
from rsibr.study.results import mean_model
from rsibr.study.scene import Scene
from rsibr.study.truth import Arrays, TruthStore
from rsibr.validate.estimate import Estimate, jackknife
from rsibr.validate.estimate_document import EstimateModel
from rsibr.validate.metrics import COVERED, denominator
from rsibr.validate.reference import MINIMUM_BUFFERS, Reference

Array = NDArray[np.float64]

_LOBE_BRANCH = 0x6C6F_6265
"""Branch of the seed tree (the letters "lobe")."""


def lobe_key(scene: Scene, frame: NDArray[np.float64], samples: int) -> dict[str, object]:
    """What the truth of the lobes depends on."""
    return {"kind": "lobes", **scene.identity, "frame": frame.tolist(), "samples": samples}


def lobe_truth(scene: Scene, frame: NDArray[np.float64], samples: int, store: TruthStore) -> Arrays:
    """Radiance of each lobe from a judged view, as the bake would render it there, in independent buffers.

    A path tracer cannot tell the lobes apart, so that this truth shares the bake's integrator and its split of the
    material: what it judges is the warp. No random number is shared.

    Returns
    -------
    dict of str to ndarray, shape (K, N, N, 3)
        By the name of the lobe; one entry alone where the material has but one.
    """

    def make() -> tuple[Arrays, dict[str, object]]:
        bsdf = scene.material.bsdf()
        integrator = SphereIntegrator(scene.environment.emitter(), bsdf, scene.resolution, LobeSplit.of(bsdf))
        each = -(-samples // MINIMUM_BUFFERS)
        view = (frame[:, 2] + 0.0).view(np.uint32)  # + 0.0: −0 and 0 are one direction
        branches = [(_LOBE_BRANCH, *(int(word) for word in view), block) for block in range(MINIMUM_BUFFERS)]
        seeds = [np.random.SeedSequence(scene.seed, spawn_key=branch) for branch in branches]
        blocks = [integrator.block(frame, each, seed) for seed in seeds]
        return {
            name: np.stack([integrator.image(block[:, k]) for block in blocks])
            for k, name in enumerate(integrator.lobe_names)
        }, {}

    return store.get(lobe_key(scene, frame, samples), make)[0]


def lobe_errors(
    method: LobedMethod,
    names: Sequence[str],
    frames: Sequence[NDArray[np.float64]],
    truths: Sequence[Arrays],
    references: Sequence[Reference],
) -> dict[str, EstimateModel]:
    """Relative MSE that each lobe's own error makes, mean over the views.

    Parameters
    ----------
    method : LobedMethod
        Its lobes have `names`, in their order.
    frames, truths, references
        Of the judged views: frame, truth of each lobe, and truth of the whole, which errors are relative to.

    Notes
    -----
    Errors of lobes that cancel or add up in the sum make these differ from shares of the whole relMSE.
    """
    found = {}
    for name, lobe in zip(names, method.lobes, strict=True):
        alone = replace(method, lobes=[lobe])
        errors = []
        for frame, truth, reference in zip(frames, truths, references, strict=True):
            picture = run(alone, frame, reference.buffers.shape[1]).image
            errors.append(_error(picture, truth[name], reference))
        found[name] = mean_model(errors)
    return found


def _error(picture: NDArray[np.float32], buffers: NDArray[np.float32], reference: Reference) -> Estimate:
    """Squared error against the mean of the buffers, their noise taken out, relative to the whole radiance."""
    judged = reference.coverage >= COVERED
    relative_to = denominator(reference.buffers[:, judged].mean(axis=0, dtype=np.float64))
    a, truth = picture[judged].astype(np.float64), buffers[:, judged].astype(np.float64)

    def average(kept: Array) -> float:
        noise = kept.var(axis=0, ddof=1) / len(kept)
        return float(np.mean(((a - kept.mean(axis=0)) ** 2 - noise) / relative_to))

    left_out = np.array([average(np.delete(truth, k, axis=0)) for k in range(len(truth))])
    return jackknife(average(truth), left_out)
