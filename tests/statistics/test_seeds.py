"""Who draws random numbers draws its own: bake, pilots, references and points, each of every view.

Estimates that share random numbers share their noise: a reference would find a bake too good, a pilot would steer the
very samples that it has seen, and views would be wrong in the same places.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from rsibr.baking.blocks import Blocks
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.noise_pilot import NoisePilot
from rsibr.baking.pilot import sampling_ratio
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.validation.lobe_reference import LobeReference
from rsibr.validation.reference import ReferenceRenderer
from tests.validation.doubles import GREY_SKY, LAMBERT

N = 8
ROOT_SEEDS = (0, 5)
VIEWS = [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.3, -0.5, -0.8)]
FRAMES = [view_frame(view) for view in VIEWS]


@pytest.fixture
def taken(monkeypatch):
    """Seeds of all launches, in order; those of the reference are recorded instead of rendered."""
    seeds: list[int] = []
    launch = SphereIntegrator._launch

    def recorded(self, matrix, texels, samples, seed):
        seeds.append(seed)
        return launch(self, matrix, texels, samples, seed)

    def rendered(self, seed, spp):
        seeds.append(seed)
        return np.ones((N, N, 4), np.float32)

    monkeypatch.setattr(SphereIntegrator, "_launch", recorded)
    monkeypatch.setattr(ReferenceRenderer, "_film", rendered)
    monkeypatch.setattr(ReferenceRenderer, "_warm_up", lambda *_: 0.0)  # its samples are thrown away
    return seeds


def test_no_two_estimates_share_a_seed(taken):
    """Equal only by chance: 2e-6 for these 150 seeds of 32 bits, which are the same in each run."""
    integrator = SphereIntegrator(GREY_SKY.emitter(), LAMBERT.bsdf(), N, max_lanes=N * N * 4)
    renderer = ReferenceRenderer(GREY_SKY, LAMBERT, N, max_lanes=N * N * 8)
    drawn: dict[tuple, set[int]] = {}

    def record(*name):
        drawn[name] = set(taken)
        taken.clear()

    for seed in ROOT_SEEDS:
        pilot = NoisePilot(integrator, 8, seed)
        by_lobe = LobeReference(integrator, samples=16, buffers=4, seed=seed)
        for index, frame in enumerate(FRAMES):
            bake_view(integrator, frame, Blocks(4, 4), seed=seed, index=index)
            record("bake", seed, index)
            pilot.look(frame, index)
            record("pilot", seed, index)
            by_lobe.buffers(frame)
            record("reference of the lobes", seed, index)
            renderer.render(frame, samples=128, seed=seed)
            record("reference", seed, index)
    sampling_ratio(GREY_SKY.emitter(), LAMBERT.bsdf(), 4)
    record("trial of the sampling")

    assert len(drawn) == 4 * len(VIEWS) * len(ROOT_SEEDS) + 1
    assert all(len(seeds) >= 3 for seeds in drawn.values())
    shared = [(a, b) for a, b in combinations(drawn, 2) if drawn[a] & drawn[b]]
    assert shared == []


def test_the_bake_takes_the_branch_of_its_view(taken):
    """Otherwise a resumed bake, which renders the missing views alone, would differ from one in a go."""
    integrator = SphereIntegrator(GREY_SKY.emitter(), LAMBERT.bsdf(), N)
    bake_view(integrator, FRAMES[0], Blocks(4, 2), seed=7, index=3)
    assert taken == list(np.random.SeedSequence(7, spawn_key=(3,)).generate_state(1))


def test_the_buffers_of_a_reference_share_no_seed(taken):
    ReferenceRenderer(GREY_SKY, LAMBERT, N, max_lanes=N * N * 8).render(FRAMES[0], samples=256)
    assert len(set(taken)) == len(taken) == 8 * 4
    taken.clear()
    integrator = SphereIntegrator(GREY_SKY.emitter(), LAMBERT.bsdf(), N)
    LobeReference(integrator, samples=32, buffers=8, seed=0).buffers(FRAMES[0])
    assert len(set(taken)) == len(taken) == 8
