"""Noise foretold from a bake's own texels: as large as it becomes, from other samples, so that targets are kept."""

import time

import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking import texel_pilot
from rsibr.baking.blocks import MAX_BLOCKS, Blocks
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.sampling import Sampler, Steering
from rsibr.baking.texel_pilot import TexelPilot
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.scene.config import SamplingConfig
from rsibr.store.noise import COVERED, map_noise
from tests.planning.scenes import sun

FRAMES = [view_frame(view) for view in ([1, 2, 3], [0, 1, 0.2], [-1, 0.3, 0.4], [0.2, -1, 0.5])]
BSDFS = {
    "plastic": {"type": "roughplastic", "alpha": 0.2},
    "metal": {"type": "roughconductor", "alpha": 0.15},
    "coat": {"type": "principled", "roughness": 0.4, "clearcoat": 1.0, "clearcoat_gloss": 0.9},
}


def integrator(name="metal", side=40):
    return SphereIntegrator(sun().emitter(), mi.load_dict(BSDFS[name]), side)


def test_it_foretells_the_noise_of_the_maps():
    """Of the judged texels of all views, for blocks as the bake takes them; within 4 of its standard errors."""
    pilot, blocks = TexelPilot(integrator(), FRAMES, seed=3), Blocks(16, 8)
    found = pilot.look(16)
    made = [bake_view(pilot.integrator, frame, blocks, seed=3, index=k) for k, frame in enumerate(FRAMES)]
    assert found.mean(8) == pytest.approx(np.mean([map_noise(one) for one in made]), rel=4 * found.error)
    assert found.error < 0.15


def test_it_looks_at_judged_texels_each_at_most_once_and_more_where_it_must(monkeypatch):
    monkeypatch.setattr(texel_pilot, "LEAST_TEXELS", 400)
    monkeypatch.setattr(texel_pilot, "LARGEST_ERROR", 1e-9)
    monkeypatch.setattr(texel_pilot, "FEW_TEXELS", 0)
    made = integrator()
    covered = made.coverage[made.coverage > 0]
    found = TexelPilot(made, FRAMES, seed=3).look(4)
    for texels in found.texels:
        assert (covered[texels] >= COVERED).all()
        assert len(np.unique(texels)) == len(texels) == int(np.ceil(texel_pilot.MOST * (covered >= COVERED).sum()))
        assert np.diff(texels).max() < 0.03 * len(covered)  # spread over the whole map, its rim included


def test_it_shares_no_random_number_with_the_bake(monkeypatch):
    """A pilot that saw the samples of the bake would choose more of them where they happened to be noisy."""
    seeds, launch = {"pilot": set(), "bake": set()}, SphereIntegrator.launch
    for who in list(seeds):

        def recorded(self, frame, texels, samples, seed, who=who):
            seeds[who].add(seed)
            return launch(self, frame, texels, samples, seed)

        monkeypatch.setattr(SphereIntegrator, "launch", recorded)
        made = integrator(side=16)
        if who == "pilot":
            TexelPilot(made, FRAMES, seed=3).look(4)
        else:
            for k, frame in enumerate(FRAMES):
                bake_view(made, frame, Blocks(4, 4), seed=3, index=k)
    assert len(seeds["pilot"]) >= len(FRAMES)
    assert not seeds["pilot"] & seeds["bake"]


@pytest.mark.parametrize("name", BSDFS)
@pytest.mark.parametrize("few", [3, MAX_BLOCKS])
def test_a_target_is_kept_closely(name, few):
    """Neither broken nor kept much too well, with uniform samples and with allocated ones (`few` of 8 forces them)."""
    made, target = integrator(name), 0.001
    steering = Steering(worth_it=1.0 if few == MAX_BLOCKS else 1e9, least_work=0, few_blocks=few)
    sampler = Sampler(made, FRAMES, SamplingConfig(target_error=target, seed=1), steering)
    record = sampler.choose(time.perf_counter())
    assert (record.scale is None) == (few == 3)
    blocks = [sampler.blocks(record, k) for k in range(len(FRAMES))]
    noise = [
        map_noise(bake_view(made, f, b, seed=1, index=k)) for k, (f, b) in enumerate(zip(FRAMES, blocks, strict=True))
    ]
    assert 0.6 < np.mean(noise) / target < 1.1  # work is measured in time, so that a busy machine chooses otherwise
    assert np.mean(noise) == pytest.approx(record.forecast_rel_mse, rel=0.2)
