"""Quick probes of a scene: error of the method `rsibr` at novel views, by map size, before any bake.

A probe bakes only the stored views around a few novel ones, twice and with few samples. Both reconstructions a, b are
compared with two renderings r, r' of the novel views. All four are independent, so the mean of (a − r)(b − r')
estimates the squared bias, and half the mean of (a − b)² the noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from rsibr import backend
from rsibr.baking.blocks import block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.planned_manifest import plan_manifest
from rsibr.baking.scene import Scene
from rsibr.baking.view import bake_view
from rsibr.errors import CheckFailed
from rsibr.geometry.frame import view_frame
from rsibr.geometry.novel_views import novel_views
from rsibr.geometry.viewpoints import Viewpoints, from_directions, icosphere
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import default_method
from rsibr.scene.config import Config, ViewsConfig
from rsibr.scene.views import load_viewpoints
from rsibr.store.described_maps import MapsInMemory
from rsibr.store.manifest import ProbeRecord, SamplingRecord
from rsibr.store.map_file import MapFile
from rsibr.store.noise import COVERED, denominator

VIEWS = 10
"""Novel views of a probe: half at centroids of triangles of stored views, the farthest points, half random."""

CONFIDENCE = 0.9
"""Probability that the mean error over `JUDGED` other views lies below the upper bound."""

JUDGED = 8
"""Number of views over which a promise is tested, as in `rsibr validate`."""

_SAMPLES = 16
_SHARP = 128
"""Samples a texel of a probe, at this number of texels a side."""

_LEAST_SAMPLES = 8

_BRANCH = 0x62756467_00000000
"""Branch of the seed tree (the letters "budg"); no random number is shared with a bake."""

_NOWHERE = Path("probe")

Frames = Sequence[NDArray[np.float64]]


class ProbedScene:
    """Probes of one scene; they share the renderings of the novel views.

    Parameters
    ----------
    scene : Scene
        Scene with material, environment, effects, seed and clamp.
    samples : int
        Samples a texel of a probe with `_SHARP` texels a side.
    """

    def __init__(self, scene: Scene, samples: int = _SAMPLES) -> None:
        self.config, self._samples = scene.config, samples
        self._scene = scene.resized(_with_all_lobes(scene.config), block=_SAMPLES)
        self.plan, self.integrator = self._scene.plan, self._scene.integrator.at_resolution(_SHARP)
        self._drawn = 0
        self._truths: dict[int, tuple[list[NDArray[np.float32]], ...]] = {}

    def viewpoints(self, views: ViewsConfig) -> Viewpoints:
        """Views that a bake stores."""
        return self._scene.planned_views(load_viewpoints(views))

    def probe(self, resolution: int, viewpoints: Viewpoints) -> ProbeRecord:
        """Measure bias and noise of reconstructions from maps of a resolution at the given stored views.

        Raises
        ------
        CheckFailed
            If they are not finite.
        """
        # ---- Two independent reconstructions of the novel views ----
        integrator = self.integrator.at_resolution(resolution)
        samples = probe_samples(resolution, self._samples)
        new = [view_frame(view) for view in self.new_views]
        one, other = self._pictures(integrator, viewpoints, new, samples)
        # ---- Two independent references of them ----
        if resolution not in self._truths:
            self._truths[resolution] = tuple(
                [self.map(integrator, frame, 2 * samples).radiance for frame in new] for _ in range(2)
            )
        truths, others = self._truths[resolution]
        # ---- Products of independent differences: squared bias and noise, relative as in relMSE ----
        judged = integrator.coverage >= COVERED
        biases, noises = [], []
        for a, b, r, s in zip(one, other, truths, others, strict=True):
            left, right, true, too = (image[judged].astype(np.float64) for image in (a, b, r, s))
            relative = denominator((true + too) / 2)
            biases.append(float(((left - true) * (right - too) / relative).mean()))
            noises.append(float(((left - right) ** 2 / 2 / relative).mean()))
        if not np.isfinite([*biases, *noises]).all():
            raise CheckFailed(
                "probes of the maps are not finite (NaN or infinite), so no budget can be kept",
                where=f"{self._scene.material.name} under {self._scene.environment.name}",
                fix="bake without the budget: `rsibr check` then shows where; mend the material",
            )
        return ProbeRecord(
            resolution=resolution,
            views=len(viewpoints),
            samples=samples,
            bias=float(np.mean(biases)),
            upper=upper_bound(biases),
            noise=float(np.mean(noises)),
        )

    @cached_property
    def new_views(self) -> list[NDArray[np.float64]]:
        """Novel views of the probes, the same for every candidate."""
        return new_views(self._coarsest, self.config.sampling.seed, VIEWS)

    @property
    def _coarsest(self) -> Viewpoints:
        """Views of the user's file, or the icosahedron.

        Subdivision keeps a triangle with the same centroid in the middle of each triangle, so the centroids of the
        icosahedron remain the points farthest from the stored views.
        """
        return self.viewpoints(self.config.views if self.config.views.file else ViewsConfig())

    def work(self, resolution: int, viewpoints: Viewpoints) -> float:
        """Total number of samples of a probe."""
        maps = 2 * min(3 * VIEWS, len(viewpoints)) + (0 if resolution in self._truths else 4 * VIEWS)
        return maps * math.pi / 4 * resolution**2 * probe_samples(resolution, self._samples)

    def _around(self, viewpoints: Viewpoints, views: Frames) -> tuple[Viewpoints, set[int]]:
        """See `surrounding`; all views of a user's file, because its triangles need not form a convex hull."""
        if self.config.views.file is not None:
            return viewpoints, set(range(len(viewpoints)))
        return surrounding(viewpoints, views)

    def map(self, integrator: SphereIntegrator, frame: NDArray[np.float64], samples: int) -> MapFile:
        """Bake one view with its own random numbers."""
        self._drawn += 1
        index = _BRANCH + self._drawn
        with backend.rendering(self.plan.rendering):
            return bake_view(integrator, frame, block_sizes(samples), seed=self.config.sampling.seed, index=index)

    def _pictures(
        self, integrator: SphereIntegrator, viewpoints: Viewpoints, new: Frames, samples: int
    ) -> Iterator[list[NDArray[np.float32]]]:
        """Yield two independent reconstructions of the novel views."""
        around, needed = self._around(viewpoints, [frame[:, 2] for frame in new])
        frames = [view_frame(view) for view in around.directions]
        resolution = integrator.coverage.shape[0]
        manifest = plan_manifest(self._scene, around, SamplingRecord(block=samples, even=2))
        manifest = manifest.model_copy(update={"resolution": resolution})
        filler = self.map(integrator, frames[0], 4)
        for _ in range(2):
            maps = tuple(
                self.map(integrator, frame, samples) if index in needed else _placeholder(filler, frame)
                for index, frame in enumerate(frames)
            )
            method = MethodSet(MapsInMemory(_NOWHERE, manifest, maps, self._scene.light))[default_method()]
            yield [run(method, frame, resolution).image for frame in new]


def probe_samples(resolution: int, samples: int = _SAMPLES) -> int:
    """Samples a texel of a probe; fewer at higher resolutions, where means are over more texels.

    Parameters
    ----------
    resolution : int
        Texels a side.
    samples : int
        Samples a texel at `_SHARP` texels a side.
    """
    return max(_LEAST_SAMPLES, samples * _SHARP**2 // resolution**2)


def new_views(viewpoints: Viewpoints, seed: int, count: int) -> list[NDArray[np.float64]]:
    """Unit directions of novel views; see `rsibr.geometry.novel_views`."""
    seeds = np.random.SeedSequence(seed, spawn_key=(_BRANCH, len(viewpoints), count))
    return [view for _, view in novel_views(viewpoints, count, seeds)]


def surrounding(viewpoints: Viewpoints, views: Sequence[NDArray[np.float64]]) -> tuple[Viewpoints, set[int]]:
    """Select a subset of the stored views whose triangulation has the same triangles around the novel views.

    A facet of a convex hull is also a facet of the hull of every subset that contains its corners. The other views of
    the subset only complete the sphere, and are never looked up.

    Parameters
    ----------
    viewpoints : Viewpoints
        Stored views.
    views : sequence of ndarray, shape (3,)
        Novel unit view directions.

    Returns
    -------
    viewpoints : Viewpoints
        Corners of the triangles around the novel views, and views that complete the sphere.
    needed : set of int
        Indices of the corners in `viewpoints`.
    """
    if not len(viewpoints.triangles):
        return viewpoints, {0}
    corners = viewpoints.directions[viewpoints.triangles]
    inside = np.einsum("mij,vj->vmi", np.linalg.inv(corners.transpose(0, 2, 1)), np.array(views)).min(axis=2)
    needed = np.unique(viewpoints.triangles[inside.argmax(axis=1)])
    base = np.argmax(viewpoints.directions @ icosphere(0).directions.T, axis=0)
    kept = np.union1d(needed, base)
    fewer = from_directions(viewpoints.directions[kept])
    return fewer, set(np.flatnonzero(np.isin(kept, needed)).tolist())


def upper_bound(errors: Sequence[float]) -> float:
    """Upper prediction bound of the mean error over `JUDGED` further views, by Student's t; see `CONFIDENCE`."""
    count = len(errors)
    reach = float(student_t.ppf(CONFIDENCE, count - 1)) * math.sqrt(1 / count + 1 / JUDGED)
    return max(0.0, float(np.mean(errors))) + reach * float(np.std(errors, ddof=1))


def _with_all_lobes(config: Config) -> Config:
    """Config in which every view stores all lobes separately."""
    return config.model_copy(update={"effects": config.effects.model_copy(update={"lobe_views": "on"})})


def _placeholder(like: MapFile, frame: NDArray[np.float64]) -> MapFile:
    """Placeholder for a view that the probe never reads; all placeholders share the pixels of `like`."""
    return replace(like, view=frame[:, 2].copy(), frame=frame)
