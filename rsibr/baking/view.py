"""Bake of single views: a view is a pure function of scene, seed and index, whoever bakes it, when, and how often."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from rsibr.baking.blocks import Blocks, estimate
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.sampling import Sampler
from rsibr.progress import Progress
from rsibr.store.layers import layered
from rsibr.store.manifest import Manifest
from rsibr.store.map_file import MapFile


def bake_views(
    sampler: Sampler,
    manifest: Manifest,
    views: Sequence[int],
    store: Callable[[int, MapFile, float], object],
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> None:
    """Bake some views of a bake, and store each of them.

    Parameters
    ----------
    sampler : Sampler
        Integrator, frames and samples of the scene.
    manifest : Manifest
        Manifest of the bake, with its samples and lobes.
    views : sequence of int
        Views to bake, in this order.
    store : callable
        Called in a thread of its own with index, map and render time [s] of each view, while the next one is rendered.
    on_progress : callable
        Called after each launch and each view, with progress over all views of the bake.
    """
    total, record = len(sampler.frames), manifest.sampling
    if not views or record is None:
        return
    with ThreadPoolExecutor(1) as storing:
        stored = storing.submit(lambda: None)
        for finished, index in enumerate(views, start=total - len(views)):
            start = time.perf_counter()

            def report(share: float, views_done: int = finished) -> None:
                on_progress(Progress(views_done + share, total, f"view {views_done + 1}", share))

            blocks, frame = sampler.blocks(record, index), sampler.frames[index]
            seed = sampler.config.seed
            baked = bake_view(sampler.integrator, frame, blocks, seed=seed, index=index, on_launch=report)
            seconds = max(0.0, time.perf_counter() - start)  # never negative, even if the clock jumps
            stored.result()  # raises if the last view could not be written
            stored = storing.submit(_store, store, index, layered(baked, manifest.lobes, index), seconds)
        stored.result()
    on_progress(Progress(total, total, "done", 1.0))


def _store(store: Callable[[int, MapFile, float], object], index: int, baked: MapFile, seconds: float) -> None:
    store(index, baked, seconds)


def bake_view(
    integrator: SphereIntegrator,
    frame: NDArray[np.float64],
    blocks: Blocks,
    *,
    seed: int,
    index: int,
    on_launch: Callable[[float], None] = lambda _: None,
) -> MapFile:
    """Bake one view: a pure function of the scene, the view and the seed.

    Parameters
    ----------
    integrator : SphereIntegrator
        Scene and resolution.
    frame : ndarray, shape (3, 3)
        Frame of the map, columns x, y, v.
    blocks : Blocks
        Blocks of each texel, fixed before any of these samples is drawn; see `block_sizes`.
    seed, index : int
        Root of the seed tree, and branch of the view.
    on_launch : callable
        Called with the fraction of the work done.

    Returns
    -------
    MapFile
        Mean over the blocks with a layer for each lobe, and the variance of the mean of their sum.
    """
    seeds = np.random.SeedSequence(seed, spawn_key=(index,))
    lobes, variance = estimate(integrator, frame, blocks, seeds, on_launch)
    return MapFile(
        view=frame[:, 2].copy(),
        frame=frame,
        layers={name: integrator.image(lobes[:, k]) for k, name in enumerate(integrator.lobe_names)},
        variance=integrator.image(variance),
        coverage=integrator.coverage,
        grey=integrator.grey,
    )
