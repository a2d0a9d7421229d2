"""Slopes and flattening on synthetic data, and the tables against path tracing in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.studies.analysis import analyse, convergence_of, crossover
from rsibr.studies.convergence import fit_flattening, fit_power_law
from rsibr.studies.page import slope
from tests.studies.doubles import converging, path_traced, point, scene


def test_an_exact_power_is_found():
    law = fit_power_law([1, 2, 8, 64], [3 * x**-1.25 for x in (1, 2, 8, 64)])
    assert law.slope == pytest.approx(-1.25, abs=1e-12)
    assert law.scale == pytest.approx(3)
    assert law.at(10) == pytest.approx(3 * 10**-1.25)
    assert law.where(law.at(7)) == pytest.approx(7)
    assert law.where(0.0) is None
    assert fit_power_law([1, 2, 3], [5.0, 5.0, 5.0]).where(1.0) is None
    assert law.range == (1, 64)
    assert law.ci95 == pytest.approx((-1.25, -1.25), abs=1e-6)


def test_the_interval_of_a_slope_covers_95_percent(rng):
    """400 fits with noise: 380 ± 4·4.4 hold the truth; false alarm below 1e-4."""
    x = np.geomspace(1, 1000, 5)
    laws = [fit_power_law(x.tolist(), (x**-1 * np.exp(0.2 * rng.standard_normal(5))).tolist()) for _ in range(400)]
    assert 362 <= sum(law.ci95[0] <= -1 <= law.ci95[1] for law in laws) <= 398


@pytest.mark.parametrize(("x", "y"), [([1, 2], [1, 2]), ([1, 2, 0], [1, 2, 3]), ([1, 2, 3], [1, -2, 3])])
def test_a_slope_needs_three_positive_points(x, y):
    with pytest.raises(ValueError, match="three points"):
        fit_power_law(x, y)


def test_bias_and_noise_are_told_apart():
    flattening = fit_flattening([16, 64, 256], [0.02 + 0.5 / n for n in (16, 64, 256)])
    assert (flattening.bias, flattening.noise) == pytest.approx((0.02, 0.5))
    assert flattening.samples == pytest.approx(25)
    assert flattening.at(25) == pytest.approx(0.04)


def test_neither_bias_nor_noise_is_negative():
    steep = fit_flattening([16, 64, 256], [n**-1.3 for n in (16, 64, 256)])
    assert steep.bias == 0
    assert steep.samples is None
    rising = fit_flattening([16, 64, 256], [1.0, 1.1, 1.2])
    assert rising.noise == 0
    assert rising.samples == 0


@pytest.mark.parametrize(("n", "e"), [([16], [1.0]), ([16, 64], [1.0, 0.0])])
def test_a_flattening_needs_two_positive_points(n, e):
    with pytest.raises(ValueError, match="two points"):
        fit_flattening(n, e)


def test_a_curve_says_where_it_flattens_in_samples_and_in_seconds():
    (curve,) = convergence_of(converging(0.02, 0.5))
    assert curve.label == "rsibr, 12 views, 64²"
    assert curve.flattens_at_samples == pytest.approx(25)
    assert curve.flattens_at_seconds == pytest.approx(0.1 + 0.025)
    assert curve.predicted_noise == pytest.approx(0.5)
    assert -1 < curve.slope.slope < 0


def test_two_points_are_no_curve_and_a_curve_below_the_floor_has_no_slope():
    assert convergence_of(converging(0.02, 0.5)[:2]) == []
    hidden = [*converging(0.0, 1e-3, counts=(16, 64)), point(-1e-6, 1.0, samples=256)]
    (curve,) = convergence_of(hidden)
    assert curve.slope is None
    assert curve.noise == pytest.approx(1e-3)


def test_path_tracing_has_the_slope_of_its_samples():
    found = analyse(scene(converging(0.01, 0.1)), frames=10)
    assert found.path_tracing.slope == pytest.approx(-1)
    assert found.progressive.slope == pytest.approx(-1)
    assert found.path_tracing.scale == pytest.approx(1e-3)


def test_equal_time_and_equal_error_in_closed_form():
    """Path tracing: relMSE 1e-3/t. A bake of 2 s, then 10 pictures of 1 ms: 2.01 s, of path tracing 0.201 s each."""
    (row,) = analyse(scene([point(0.01, 2.0)]), frames=10).rivals
    assert row.job_seconds == pytest.approx(2.01)
    assert row.path_tracing_rel_mse == pytest.approx(1e-3 / 0.201)
    assert row.path_tracing_seconds == pytest.approx(0.1)
    assert row.break_even_views == 21  # 2 s over the 99 ms that each picture saves
    assert not row.extrapolated
    assert analyse(scene([point(0.01, 200.0)]), frames=10).rivals[0].extrapolated


def test_all_that_is_spent_once_counts_in_every_analysis():
    """Rendering of 1 s, set-up of 2, preparation of 3, compilation of 4, then 10 pictures of 1 ms."""
    whole = point(0.01, 1.0, setup_seconds=2.0, prepare_seconds=3.0, compile_seconds=4.0)
    assert whole.once_seconds == pytest.approx(10)
    assert whole.job_seconds(10) == pytest.approx(10.01)
    (row,) = analyse(scene([whole]), frames=10).rivals
    assert row.job_seconds == pytest.approx(10.01)
    assert row.break_even_views == 102  # 10 s over the 99 ms that each picture saves
    cheap = point(0.02, 2.0, method="cabral1999")  # renders longer, and is ready much sooner
    assert analyse(scene([whole, cheap]), frames=10).fronts["once_seconds"].on == [cheap.label, whole.label]
    assert analyse(scene([whole, cheap]), frames=10).job_front == [cheap.label, whole.label]
    assert crossover([whole], analyse(scene([whole]), frames=10).path_tracing.law, 1000).from_seconds == pytest.approx(
        11
    )


def test_set_up_leaves_the_slope_of_the_noise_as_it_is():
    bare = converging(0.0, 1.0)
    slow = [p.model_copy(update={"bake": p.bake.compiling(50.0)}) for p in bare]
    assert slow[0].bake.seconds.median == pytest.approx(bare[0].bake.seconds.median + 50)
    (one,), (other,) = convergence_of(bare), convergence_of(slow)
    assert one.slope == other.slope


def test_what_is_below_the_noise_floor_has_no_equal_error():
    (row,) = analyse(scene([point(-1e-6, 2.0)]), frames=10).rivals
    assert row.path_tracing_seconds is None
    assert row.break_even_views is None


def test_the_crossover_in_closed_form():
    """A job of 100 pictures: path tracing has 0.1/T. The bake ends at 2.1 s with 0.01: ahead until T = 10 s."""
    law = analyse(scene([point(0.01, 2.0)]), frames=100).path_tracing.law
    found = crossover([point(0.01, 2.0)], law, 100)
    assert found.from_seconds == pytest.approx(2.1)
    assert found.until_seconds == pytest.approx(10)
    assert crossover([point(0.01, 2.0)], law, 1).from_seconds is None
    assert crossover([point(-1e-6, 2.0)], law, 100).until_seconds is None
    assert crossover([point(0.01, 2.0), point(0.001, 5.0, views=42)], law, 100).until_seconds == pytest.approx(100)


def test_fronts_name_what_is_dominated_and_by_what():
    good, bad = point(0.01, 1.0), point(0.02, 2.0, method="cabral1999", frame_seconds=1e-4)
    found = analyse(scene([good, bad]), frames=10)
    assert found.fronts["once_seconds"].dominated == {bad.label: good.label}
    assert found.fronts["frame_seconds"].on == [bad.label, good.label]
    assert found.fronts["frame_seconds"].dominated == {}
    assert found.job_front == [good.label]


def test_what_a_reference_cannot_tell_from_none_is_no_zero_of_path_tracing():
    lost = [path_traced(n, noise=noise) for n, noise in ((64, 1.0), (256, 1.0), (1024, -1e-3))]
    assert np.isfinite(analyse(scene([point(0.01, 1.0)], path_tracing=lost), frames=1).path_tracing.slope)


def test_equal_times_tell_no_slope():
    """As of pictures whose time is all overhead."""
    law = fit_power_law([0.5, 0.5, 0.5 * (1 + 1e-15)], [3.0, 2.0, 1.0])
    assert not law.is_measured
    assert law.where(1.0) is None


def test_an_unknown_slope_says_nothing_beyond_the_measured_times():
    """Within them the line interpolates; a slope of three scattered points tells nothing outside."""
    noisy = [path_traced(n, noise=noise) for n, noise in ((64, 3.0), (144, 0.5), (256, 0.2))]
    found = analyse(scene([point(1e-9, 0.1, frame_seconds=0.001), point(0.02, 1000.0)], path_tracing=noisy), 1)
    assert not found.path_tracing.is_measured
    inside, outside = found.rivals
    assert inside.path_tracing_rel_mse is not None
    assert inside.path_tracing_seconds is None
    assert outside.path_tracing_rel_mse is None
    assert not found.crossover[0].is_measured
    assert slope(found.path_tracing) == "not measurable from 3 points"
    assert slope(found.progressive) == "\u22121.00 (\u22121.00 to \u22121.00)"
