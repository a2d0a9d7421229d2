"""Predicted noise against the noise that independent bakes show, and the parts that an error is told apart into."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.scene.config import parse_config
from rsibr.studies.baked import BakedMaps
from rsibr.studies.noise import noise_of, noisy_maps, relative_square, without
from rsibr.validation.report.document import EstimateModel
from tests.validation.doubles import noisy_reference

FRAMES = [view_frame(view) for view in ((1, 2, 3), (-3, 1, 0.5), (0.2, -1, 0.7))]
RESOLUTION = 24


@pytest.fixture(scope="module")
def bakes(asymmetric_environment, tmp_path_factory):
    """Six bakes that differ in their seed alone."""
    tables = {
        "environment": {"file": str(asymmetric_environment)},
        "material": {"preset": "glossy-plastic"},
        "map": {"resolution": RESOLUTION},
    }
    folder = tmp_path_factory.mktemp("bakes")
    configs = [parse_config({**tables, "sampling": {"samples": 64, "seed": seed}}, folder) for seed in range(6)]
    return [bake(config, out=folder / f"{seed}.rsibr") for seed, config in enumerate(configs)]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nearest", "cabral1999", "rsibr"])
def test_the_predicted_noise_is_that_of_independent_bakes(bakes, method):
    """Within a quarter.

    The spread of six bakes over 1300 texel means is known to 5 %, the prediction of rsibr's
    noise leans on sharing the variance out among lobes; taking out the factor of any step doubles or halves it.
    """
    sets = [MethodSet(one) for one in bakes]
    sets[0][method].map(FRAMES[0], RESOLUTION)  # what it learns from its bake, all share: another belief is no noise
    for one in sets[1:]:
        one.inputs.learnt = sets[0].inputs.learnt
    pictures = np.array([[run(one[method], f, RESOLUTION).image for f in FRAMES] for one in sets])
    rng = np.random.default_rng(0)
    references = [noisy_reference(np.maximum(mean, 1e-3), 1e-6, rng) for mean in pictures.mean(axis=0)]
    spread = pictures - pictures.mean(axis=0)
    measured = np.mean([relative_square(s, r) for one in spread for s, r in zip(one, references, strict=True)]) * 6 / 5
    noisier = MethodSet(noisy_maps(bakes[0], seed=3))
    noisier.inputs.learnt = sets[0].inputs.learnt
    noisy = noisier[method]
    predicted = noise_of(pictures[0], [run(noisy, f, RESOLUTION).image for f in FRAMES], references)
    assert predicted == pytest.approx(measured, rel=0.25)


def test_another_belief_is_no_noise(bakes):
    """`rsibr` learns from the maps how far to believe its residuals: from the bake's own, not from noisier ones."""
    judged = SimpleNamespace(scene=SimpleNamespace(seed=0))
    baked = BakedMaps(judged, bakes[0], None, None)
    plain, noisy = baked._at("float32"), baked._at("noisy")
    alone = [MethodSet(noisy_maps(bakes[0], seed=0)), plain, noisy]
    learnt, own, shared = (np.array(made["rsibr"].trust.nodes) for made in alone)
    assert np.array_equal(shared, own)
    assert not np.array_equal(shared, learnt)


def test_noise_added_to_a_map_has_its_variance_and_leaves_the_rest(bakes):
    stored = bakes[0].map(0)
    added = [noisy_maps(bakes[0], seed=seed).map(0).radiance - stored.radiance for seed in range(64)]
    judged = (stored.coverage > 0.5) & (stored.variance.min(axis=-1) > 0)
    ratio = np.mean(np.square(added), axis=0)[judged] / stored.variance[judged]
    assert ratio.mean() == pytest.approx(1, abs=0.05)  # 64 draws of 1200 values: a standard error of 0.005
    again = noisy_maps(bakes[0], seed=5).map(0)
    np.testing.assert_array_equal(again.radiance - stored.radiance, added[5])
    np.testing.assert_array_equal(again.coverage, stored.coverage)


def test_a_map_without_noise_stays_as_it_is(bakes, monkeypatch):
    stored = replace(bakes[0].map(0), variance=np.zeros((RESOLUTION, RESOLUTION, 3), np.float32))
    monkeypatch.setattr("rsibr.store.bake.Bake.map", lambda self, index: stored)
    noisy = noisy_maps(bakes[0], seed=0).map(0)
    np.testing.assert_array_equal(noisy.radiance, stored.radiance)


def test_a_relative_square_in_closed_form():
    reference = noisy_reference(np.full((16, 16, 3), 2.0), 0.0, np.random.default_rng(0))
    assert relative_square(np.full((16, 16, 3), 0.2), reference) == pytest.approx(0.04 / (4 + 0.04))


def test_noise_is_taken_out_of_value_and_interval():
    total = EstimateModel(value=0.03, ci95=(0.028, 0.032), below_noise_floor=False)
    rest = without(total, 0.029)
    assert rest.value == pytest.approx(0.001)
    assert rest.ci95 == pytest.approx((-0.001, 0.003))
    assert rest.below_noise_floor
    assert not without(total, 0.01).below_noise_floor
