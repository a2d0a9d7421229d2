"""Errors of the fitted lobes, held against shifts of known shape."""

import numpy as np
import pytest

from rsibr.lobes.albedo import NODES
from rsibr.lobes.fit_error import COSINES, FitErrors, held_out
from rsibr.lobes.probe_directions import COSINES_OUT, probe_directions
from rsibr.lobes.split import LobeSplit
from rsibr.scene.mitsuba_bsdf import load_bsdf
from tests.planning.scenes import BRUSHED, DIFFUSE, METAL, MIRROR, PLASTIC, RETRO


def errors_of(plugin):
    return FitErrors.of(LobeSplit.of(load_bsdf(plugin, "the test")))


def test_no_direction_of_the_fit_is_judged():
    fitted, judged = probe_directions(), held_out()
    assert not set(COSINES) & set(COSINES_OUT)
    assert len(judged.views) == len(COSINES)
    nearest = [np.abs(judged.wi @ w).max() for w in fitted.wi[::97]]
    assert np.mean(np.array(nearest) < 1 - 1e-12) > 0.9


@pytest.mark.parametrize(("plugin", "most"), [(DIFFUSE, 1e-4), (MIRROR, 0.0), (PLASTIC, 0.02), (METAL, 0.03)])
def test_what_the_model_represents_has_a_small_error(plugin, most):
    errors = errors_of(plugin)
    assert errors.whole.shape == (len(COSINES),)
    assert errors.whole.max() <= most
    assert errors.mean <= errors.whole.max()


@pytest.mark.parametrize("plugin", [BRUSHED, RETRO], ids=["brushed", "retroreflective"])
def test_what_it_cannot_represent_has_a_large_one(plugin):
    assert errors_of(plugin).mean > 0.15


def test_lobes_count_by_their_light_at_the_angle():
    """Two lobes of equal albedos, then one that is three times the other: plain weighted means."""
    errors = [np.full(len(COSINES), 0.4), np.zeros(len(COSINES))]
    even, third = np.ones((NODES, 3)), np.full((NODES, 3), 1 / 3)
    assert FitErrors.weighted(errors, [even, even]).whole == pytest.approx([0.2] * len(COSINES))
    assert FitErrors.weighted(errors, [third, even]).mean == pytest.approx(0.1)
    assert FitErrors.weighted(errors, [0 * even, 0 * even]).mean == 0


def test_the_mean_is_over_the_disk():
    """An error that falls with cos²: its mean is ∫ 2μ (1 − μ²) dμ = 1/2, as far as six angles resolve it."""
    error = 1 - np.array(COSINES) ** 2
    assert FitErrors.weighted([error], [np.ones((NODES, 3))]).mean == pytest.approx(0.5, abs=0.03)
