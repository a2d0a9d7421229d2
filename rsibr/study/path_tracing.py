"""Path tracing as a rival: one picture in as few launches as it takes, timed, by random numbers of its own."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.study.results import ErrorRecord, PathTracingRecord, Timing
from rsibr.validate.flip import Exposures
from rsibr.validate.metrics import compare
from rsibr.validate.reference import LANES_PER_LAUNCH, Reference, ReferenceRenderer

_RIVAL_BRANCH = 0x7269_7661
"""Branch of the seed tree (the letters "riva"): no random number is shared with the references or with a bake."""


class PathTracer(ReferenceRenderer):
    """The renderer of the references, asked for a single picture as a user would: no buffers to tell noise by."""

    def picture(
        self, frame: NDArray[np.float64], samples: int, seeds: np.random.SeedSequence
    ) -> tuple[NDArray[np.float32], float]:
        """Path-trace the sphere map of one view.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Frame of the map.
        samples : int
            Samples a texel, split evenly where one launch cannot hold them; a square number is stratified best.
        seeds : SeedSequence
            Fixes every random number.

        Returns
        -------
        image : ndarray, shape (N, N, 3), float32
            Radiance, coverage divided out.
        seconds : float
            Time of the rendering, device finished, nothing compiled.
        """
        launches = -(-samples * self.resolution**2 // LANES_PER_LAUNCH)
        spp = -(-samples // launches)
        self._look_along(frame)
        self._warm_up(spp)
        start = time.perf_counter()
        films = [self._film(int(seed), spp) for seed in seeds.generate_state(launches)]
        backend.synchronize()
        seconds = time.perf_counter() - start
        film = np.asarray(np.mean(films, axis=0, dtype=np.float64))
        covered = film[..., 3:] > 0
        image = np.where(covered, film[..., :3] / np.where(covered, film[..., 3:], 1.0), 0.0)
        return image.astype(np.float32), seconds


def path_tracing_point(
    tracer: PathTracer,
    frames: Sequence[NDArray[np.float64]],
    references: Sequence[Reference],
    exposures: Exposures,
    samples: int,
    *,
    seed: int,
    runs: int,
) -> PathTracingRecord:
    """Error and time of path-traced pictures of all judged views.

    Parameters
    ----------
    tracer : PathTracer
    frames, references
        Of the judged views.
    exposures : Exposures
        Those of FLIP.
    samples : int
        Samples a texel.
    seed : int
        Root of the seed tree.
    runs : int
        Timed pictures at least, all views together.
    """
    errors, seconds = [], []
    for number in range(max(runs, len(frames))):
        view = number % len(frames)
        seeds = np.random.SeedSequence(seed, spawn_key=(_RIVAL_BRANCH, samples, number))
        image, took = tracer.picture(frames[view], samples, seeds)
        seconds.append(took)
        if number < len(frames):
            errors.append(compare(image, references[view], exposures, name=f"path tracing, {samples} samples"))
    return PathTracingRecord(samples=samples, error=ErrorRecord.of(errors), seconds=Timing.of(seconds))
