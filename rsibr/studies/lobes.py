"""Error by lobe: the picture of each lobe against the reference of that lobe."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rsibr.methods.protocol import Method
from rsibr.methods.reconstruction import run
from rsibr.store.noise import COVERED
from rsibr.studies.results import mean_model
from rsibr.studies.scene import StudyScene
from rsibr.studies.truth import Arrays, TruthStore
from rsibr.validation.estimate import Estimate
from rsibr.validation.lobe_reference import LobeReference
from rsibr.validation.lobes import lobe_errors
from rsibr.validation.reference import MINIMUM_BUFFERS, Reference
from rsibr.validation.report.estimate_document import EstimateModel


def lobe_key(scene: StudyScene, frame: NDArray[np.float64], samples: int) -> dict[str, object]:
    """Key of the references of the lobes: everything that they depend on."""
    return {"kind": "lobes", **scene.identity, "frame": frame.tolist(), "samples": samples}


def lobe_truth(scene: StudyScene, frame: NDArray[np.float64], samples: int, store: TruthStore) -> Arrays:
    """Radiance of each lobe from a judged view, in independent buffers; see `rsibr.validation.lobe_reference`.

    Returns
    -------
    dict of str to ndarray, shape (K, N, N, 3)
        By the name of the lobe; one entry alone where the material has but one.
    """

    def make() -> tuple[Arrays, dict[str, object]]:
        integrator = scene.prepared.parts.integrator(scene.resolution, scene.rendering)
        truth = LobeReference(integrator, samples=samples, buffers=MINIMUM_BUFFERS, seed=scene.seed)
        buffers = truth.buffers(frame)
        images = {
            name: np.stack([truth.image(values) for values in buffers[:, :, k]]) for k, name in enumerate(truth.names)
        }
        return images, {}

    return store.get(lobe_key(scene, frame, samples), make)[0]


def mean_lobe_errors(
    parts: Mapping[str, Method],
    frames: Sequence[NDArray[np.float64]],
    truths: Sequence[Arrays],
    references: Sequence[Reference],
) -> dict[str, EstimateModel]:
    """Contribution of each lobe to relMSE, mean over the views; see `rsibr.validation.lobes.lobe_errors`.

    Parameters
    ----------
    parts : dict of str to Method
        The part of each lobe in the pictures.
    frames, truths, references
        Of the judged views: frame, truth of each lobe, and truth of the whole, whose coverage says what is judged.
    """
    found: dict[str, list[Estimate]] = {name: [] for name in parts}
    for frame, truth, reference in zip(frames, truths, references, strict=True):
        judged = reference.coverage >= COVERED
        images = [run(part, frame, len(judged)).image[judged] for part in parts.values()]
        buffers = np.stack([truth[name][:, judged] for name in parts], axis=2)
        for name, error in zip(parts, lobe_errors(np.stack(images, axis=1), buffers), strict=True):
            found[name].append(error)
    return {name: mean_model(errors) for name, errors in found.items()}
