"""What is said over all views: means, and what a bake saves."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.validation.metrics import noise_floor
from rsibr.validation.results import break_even_views
from tests.validation.results_double import small_validation


@pytest.mark.parametrize(
    ("bake", "path_tracing", "reconstruct", "views"),
    [(10, 1.5, 0.5, 10), (10.1, 1.5, 0.5, 11), (10, 0.5, 0.5, None), (10, 0.4, 0.5, None), (0, 1.5, 0.5, 0)],
)
def test_break_even_is_where_the_lines_cross(bake, path_tracing, reconstruct, views):
    assert break_even_views(bake, path_tracing, reconstruct) == views


def test_summaries_are_means_over_the_views():
    validation = small_validation()
    for name in validation.methods:
        errors = [view.methods[name].error for view in validation.views]
        summary = validation.summary[name]
        assert summary.rel_mse.value == pytest.approx(np.mean([e.rel_mse.value for e in errors]))
        assert summary.smape == pytest.approx(np.mean([e.smape for e in errors]))
        assert summary.worst_texel == max(e.worst_texel.error for e in errors)
        assert summary.seconds == pytest.approx(0.0025)
        assert summary.seconds_range == pytest.approx((0.002, 0.003))
        assert summary.rel_mse_zones.keys() == {"inner", "middle", "rim"}


def test_path_tracing_to_equal_error_follows_one_over_samples():
    # The noise floor is reached with all samples in one second; an error a hundred times as large takes a hundredth.
    validation = small_validation(factors={"off": 1.1})
    floor = np.mean([noise_floor(view.reference) for view in validation.views])
    summary = validation.summary["off"]
    assert summary.path_tracing_seconds == pytest.approx(floor / summary.rel_mse.value)
    assert summary.break_even_views == np.ceil(10 / (summary.path_tracing_seconds - 0.0025))


def test_path_tracing_takes_one_sample_at_least():
    summary = small_validation(factors={"far off": 50.0}).summary["far off"]
    assert summary.path_tracing_seconds == 1 / 512


def test_below_the_noise_floor_path_tracing_is_not_made_dearer_than_is_known():
    validation = small_validation()
    summary = validation.summary["perfect"]
    assert summary.rel_mse.below_noise_floor
    floor = np.mean([view.noise_floor for view in validation.views])
    assert summary.path_tracing_seconds == pytest.approx(floor / summary.rel_mse.ci95[1])


def test_a_slow_reconstruction_never_pays():
    assert small_validation(factors={"far off": 50.0}).summary["far off"].break_even_views is None
