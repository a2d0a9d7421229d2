"""Path tracing for comparison: single pictures in few launches, timed, with their own random numbers."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.studies.results import ErrorRecord, PathTracingRecord, Timing
from rsibr.validation.flip import Exposures
from rsibr.validation.metrics import MapError, compare
from rsibr.validation.reference import Reference, ReferenceRenderer, stratified

_RIVAL_BRANCH = 0x7269_7661
"""Branch of the seed tree (the letters "riva"): no random number is shared with the references or with a bake."""


class PathTracer(ReferenceRenderer):
    """Renderer of the references for a single picture, without independent buffers."""

    def launches(self, samples: int, pass_samples: int | None = None) -> tuple[int, int]:
        """Launches of a picture, and samples of each, rounded up to strata of a nearly square grid; see `picture`."""
        most = min(pass_samples or samples, max(1, self.max_lanes // self.resolution**2))
        launches = -(-samples // most)
        return launches, stratified(most if pass_samples else -(-samples // launches))

    def picture(
        self, frame: NDArray[np.float64], samples: int, seeds: np.random.SeedSequence, pass_samples: int | None = None
    ) -> tuple[NDArray[np.float32], float]:
        """Path-trace the sphere map of one view.

        Parameters
        ----------
        frame : ndarray, shape (3, 3)
            Frame of the map.
        samples : int
            Samples a texel at least, split evenly where one launch cannot hold them; `launches` says how many it takes.
        seeds : SeedSequence
            Fixes every random number.
        pass_samples : int, optional
            Samples of a pass, stratified among each other and not with those of another; by default all of them.

        Returns
        -------
        image : ndarray, shape (N, N, 3), float32
            Radiance, coverage divided out.
        seconds : float
            Time of the rendering, device finished, nothing compiled.
        """
        launches, spp = self.launches(samples, pass_samples)
        with backend.rendering(self.rendering):  # the change of variant is not part of a picture
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


def path_tracing_points(
    tracer: PathTracer,
    frames: Sequence[NDArray[np.float64]],
    references: Sequence[Reference],
    exposures: Exposures,
    samples: Sequence[int],
    *,
    pass_samples: int | None = None,
    seed: int,
    runs: int,
) -> list[PathTracingRecord]:
    """Error and time of path-traced pictures of all judged views.

    Parameters
    ----------
    tracer : PathTracer
    frames, references
        Of the judged views.
    exposures : Exposures
        Those of FLIP.
    samples : sequence of int
        Samples a texel at least. Interleaved, so that a slow phase of the machine affects all of them.
    pass_samples : int, optional
        Samples of a pass; by default all of a picture.
    seed : int
        Root of the seed tree.
    runs : int
        Timed pictures at least, all views together.

    Returns
    -------
    list of PathTracingRecord
        One for each of `samples`, in their order.
    """
    errors: dict[int, list[MapError]] = {count: [] for count in samples}
    seconds: dict[int, list[float]] = {count: [] for count in samples}
    for number, count in product(range(max(runs, len(frames))), samples):
        view = number % len(frames)
        seeds = np.random.SeedSequence(seed, spawn_key=(_RIVAL_BRANCH, count, pass_samples or 0, number))
        image, took = tracer.picture(frames[view], count, seeds, pass_samples)
        seconds[count].append(took)
        if number < len(frames):
            errors[count].append(compare(image, references[view], exposures, name=f"path tracing, {count} samples"))
    return [
        PathTracingRecord(
            samples=math.prod(tracer.launches(count, pass_samples)),
            pass_samples=pass_samples,
            error=ErrorRecord.of(errors[count]),
            seconds=Timing.of(seconds[count]),
        )
        for count in samples
    ]
