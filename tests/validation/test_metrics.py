"""Each number of a map's error against closed forms, simulation and deliberate damage."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.errors import CheckFailed
from rsibr.store.map_file import MapFile
from rsibr.store.noise import map_noise
from rsibr.validation.flip import exposures_for
from rsibr.validation.metrics import (
    _Moments,
    compare,
    noise_floor,
    relative_mse_of_samples,
    relative_noise_map,
    zone_shares,
)
from rsibr.validation.reference import Reference
from tests.validation.doubles import disk, noisy_reference, smooth_map

EXPOSURES = exposures_for(1.0)
INSIDE = disk().astype(bool)


def exact(truth):
    """Make a reference without noise."""
    return Reference(np.stack([truth] * 8), disk(len(truth)), samples=64, seconds=1.0)


def test_identical_images_have_no_error_at_all():
    error = compare(smooth_map(), exact(smooth_map()), EXPOSURES)
    assert error.rel_mse.value == error.smape == error.flip == error.worst_texel.error == 0
    assert error.rel_mse.ci95 == (0, 0)
    assert not error.rel_mse.below_noise_floor
    assert error.energy_ratio == 1


def test_rel_mse_is_the_formula_of_the_design():
    truth = smooth_map()
    candidate = truth * np.array([1.1, 0.8, 1.0], dtype=np.float32)
    b = truth[INSIDE].astype(np.float64)
    a = candidate[INSIDE].astype(np.float64)
    by_channel = [np.mean((a[:, c] - b[:, c]) ** 2 / (b[:, c] ** 2 + (0.1 * b[:, c].mean()) ** 2)) for c in range(3)]
    error = compare(candidate, exact(truth), EXPOSURES)
    assert error.rel_mse.value == pytest.approx(np.mean(by_channel), rel=1e-12)
    assert [channel.value for channel in error.rel_mse_channels] == pytest.approx(by_channel, rel=1e-12)
    assert error.smape == pytest.approx((0.1 / 2.1 + 0.2 / 1.8) / 3, rel=1e-5)
    assert error.energy_ratio == pytest.approx((1.1 + 0.8 + 1) / 3, rel=1e-5)


def test_rel_mse_does_not_depend_on_the_unit_of_radiance(rng):
    reference = noisy_reference(smooth_map(), 0.02, rng)
    error = compare(1.1 * smooth_map(), reference, EXPOSURES)
    dim = Reference(reference.buffers * np.float32(2**-60), reference.coverage, 64, 1.0)
    scaled = compare(1.1 * smooth_map() * np.float32(2**-60), dim, EXPOSURES)
    assert scaled.rel_mse.value == pytest.approx(error.rel_mse.value, rel=1e-6)
    assert scaled.smape == pytest.approx(error.smape, rel=1e-6)


def test_zones_tell_the_rim_from_the_middle():
    truth = smooth_map(64)
    centre = (np.arange(64) + 0.5) / 32 - 1
    rim = np.hypot(centre[None], centre[:, None]) > 0.9
    error = compare(np.where(rim[..., None], 2 * truth, truth), exact(truth), EXPOSURES)
    assert error.rel_mse_zones["inner"].value == error.rel_mse_zones["middle"].value == 0
    assert error.rel_mse_zones["rim"].value > 0.9


def test_zones_add_up_to_the_whole(rng):
    reference = noisy_reference(smooth_map(), 0.05, rng)
    error = compare(rng.uniform(0.5, 2, (32, 32, 3)), reference, EXPOSURES)
    centre = (np.arange(32) + 0.5) / 16 - 1
    radius = np.hypot(centre[None], centre[:, None])[INSIDE]
    shares = [np.mean(radius < 2 / 3), np.mean((radius >= 2 / 3) & (radius < 0.9)), np.mean(radius >= 0.9)]
    whole = sum(share * zone.value for share, zone in zip(shares, error.rel_mse_zones.values(), strict=True))
    assert error.rel_mse.value == pytest.approx(whole, rel=1e-12)
    assert zone_shares(reference) == dict(zip(error.rel_mse_zones, shares, strict=True))


@pytest.fixture
def without_flip(monkeypatch):
    """Leave FLIP out of hundreds of simulations that do not look at it."""
    monkeypatch.setattr("rsibr.validation.metrics.flip_map", lambda reference, *_: np.zeros(reference.shape[:2]))


def simulated(candidate_of, trials, rng, noise=0.03):
    truth = smooth_map(24)
    exposures = exposures_for(1.0)
    return [compare(candidate_of(truth), noisy_reference(truth, noise, rng), exposures) for _ in range(trials)]


@pytest.mark.usefixtures("without_flip")
def test_intervals_of_a_real_error_cover_the_truth(rng):
    # 200 intervals of 95 %: fewer than 178 or all 200 cover with probability 2e-4 resp. 4e-5.
    truth = smooth_map(24)[disk(24).astype(bool)].astype(np.float64)
    real = np.mean((0.1 * truth) ** 2 / (truth**2 + (0.1 * truth.mean(axis=0)) ** 2))
    intervals = [error.rel_mse.ci95 for error in simulated(lambda t: 1.1 * t, 200, rng)]
    assert 178 <= sum(low <= real <= high for low, high in intervals) < 200


@pytest.mark.usefixtures("without_flip")
def test_intervals_of_a_perfect_map_cover_zero(rng):
    # At least 95 % each, by the jackknife's bias rather more: fewer than 178 of 200 with probability below 2e-4.
    errors = simulated(lambda t: t, 200, rng)
    assert sum(error.rel_mse.ci95[0] <= 0 <= error.rel_mse.ci95[1] for error in errors) >= 178
    assert sum(error.rel_mse.below_noise_floor for error in errors) >= 178


@pytest.mark.usefixtures("without_flip")
def test_the_debiased_mean_is_unbiased(rng):
    # Mean of 200 estimates within 4 standard errors of the truth: false alarms 6e-5. Taking s²/K out and leaving the
    # denominator's noise in would be off by 28 of them here.
    truth = smooth_map(24)[disk(24).astype(bool)].astype(np.float64)
    real = np.mean((0.1 * truth) ** 2 / (truth**2 + (0.1 * truth.mean(axis=0)) ** 2))
    values = np.array([error.rel_mse.value for error in simulated(lambda t: 1.1 * t, 200, rng)])
    assert abs(values.mean() - real) < 4 * values.std() / np.sqrt(200)


def test_the_noise_floor_is_what_a_biased_rel_mse_would_show(rng):
    truth = smooth_map()
    references = [noisy_reference(truth, 0.02, rng) for _ in range(20)]
    b = truth[INSIDE].astype(np.float64)
    expected = np.mean((0.02 * b) ** 2 / (b**2 + (0.1 * b.mean(axis=0)) ** 2))
    # 20 × 800 × 3 variances of 7 degrees of freedom: standard error 0.25 %; 5 of them, false alarms 6e-7.
    assert np.mean([noise_floor(reference) for reference in references]) == pytest.approx(expected, rel=0.0125)
    shown = np.nanmean(relative_noise_map(references[0]) ** 2)
    assert shown == pytest.approx(noise_floor(references[0]), rel=1e-5)


def headlines(error):
    """Take the numbers at the head of a report, as distances from perfection."""
    energy = abs(error.energy_ratio - 1)
    return np.array([error.rel_mse.value, error.smape, error.flip, energy, error.worst_texel.error])


@pytest.mark.parametrize("damage", ["firefly", "hole", "lost sun"])
def test_a_headline_number_sees(damage, rng):
    truth = smooth_map(96)
    truth[30:32, 40:42] = 1000.0  # a sun
    candidate = truth.copy()
    if damage == "firefly":
        candidate[60, 50] = 1e4
    elif damage == "hole":
        candidate[50:60, 45:55] = 0.0
    else:
        candidate[30:32, 40:42] = 1.0
    reference = noisy_reference(truth, 0.02, rng)
    reference = Reference(reference.buffers, disk(96), 64, 1.0)
    sound = headlines(compare(truth, reference, EXPOSURES))
    damaged = compare(candidate, reference, EXPOSURES)
    assert (headlines(damaged) > 10 * sound).any()
    assert damaged.worst_texel.error > 0.25
    assert not damaged.rel_mse.below_noise_floor


def test_the_worst_texel_is_found_in_map_coordinates():
    candidate = smooth_map()
    candidate[4, 20] = 50.0  # row 4 from the top
    worst = compare(candidate, exact(smooth_map()), EXPOSURES).worst_texel
    assert (worst.s, worst.t) == (20.5 / 32, 1 - 4.5 / 32)
    assert worst.error > 1


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_raises_and_says_where(value):
    candidate = smooth_map()
    candidate[7, 9, 1] = value
    with pytest.raises(CheckFailed, match="cabral1999, row 7, column 9, channel G"):
        compare(candidate, exact(smooth_map()), EXPOSURES, "cabral1999")


def test_a_nan_in_the_reference_raises():
    reference = exact(smooth_map())
    reference.buffers[5, 16, 16, 2] = np.nan
    with pytest.raises(CheckFailed, match="reference, buffer 5, row 16, column 16, channel B"):
        compare(smooth_map(), reference, EXPOSURES)


def test_what_lies_outside_the_disk_does_not_count():
    candidate = np.where(INSIDE[..., None], smooth_map(), np.nan)
    error = compare(candidate, exact(smooth_map()), EXPOSURES)
    assert error.rel_mse.value == error.flip == 0
    assert np.isnan(error.relative_error[0, 0])


def test_an_all_black_environment_keeps_the_numbers_finite():
    black = np.zeros((32, 32, 3), dtype=np.float32)
    error = compare(black, exact(black), exposures_for(0.0))
    assert (headlines(error) == 0).all()
    assert error.rel_mse.ci95 == (0, 0)


def test_light_where_all_is_black_is_loud_and_finite():
    black = np.zeros((32, 32, 3), dtype=np.float32)
    error = compare(smooth_map(), exact(black), exposures_for(0.0))
    assert 1e10 < error.rel_mse.value < np.inf
    assert error.energy_ratio is None
    assert error.smape == 1
    assert error.flip > 0


def test_rounding_in_a_black_channel_is_no_error():
    truth = smooth_map() * np.array([1, 1, 0], dtype=np.float32)
    candidate = truth + np.array([0, 0, 1e-8], dtype=np.float32)
    assert compare(candidate, exact(truth), EXPOSURES).rel_mse.value < 1e-5


@pytest.mark.parametrize(("shape", "buffers"), [((16, 16, 3), 8), ((32, 32, 3), 2)])
def test_what_cannot_be_compared_raises(shape, buffers):
    reference = Reference(np.stack([smooth_map()] * buffers), disk(), 64, 1.0)
    with pytest.raises(ValueError, match="cannot compare"):
        compare(np.ones(shape), reference, EXPOSURES)


def rim_of(coverage, resolution=32):
    """Coverage of a map: `coverage` in the outermost texels of the disk, 1 inside; and where those texels are."""
    centre = (np.arange(resolution) + 0.5) * 2 / resolution - 1
    radius = np.hypot(centre[None], centre[:, None])
    rim = (radius > 0.9) & (radius <= 1)
    return np.where(rim, np.float32(coverage), disk(resolution)), rim


def test_texels_of_less_than_half_coverage_are_not_judged(rng):
    """Whatever stands there: every number is that of the texels with coverage ≥ ½ alone, whose rim is at 0.9."""
    coverage, rim = rim_of(np.nextafter(np.float32(0.5), np.float32(0)))
    buffers = noisy_reference(smooth_map(), 0.05, rng).buffers
    candidate = 1.1 * smooth_map()
    inside = compare(candidate, Reference(buffers, np.where(rim, np.float32(0), coverage), 64, 1.0), EXPOSURES)
    candidate[rim], buffers[:, rim] = 50.0, 3 * buffers[:, rim]
    reference = Reference(buffers, coverage, 64, 1.0)
    found = compare(candidate, reference, EXPOSURES)
    assert (headlines(found) == headlines(inside)).all()
    assert found.rel_mse == inside.rel_mse
    assert found.noise_floor == inside.noise_floor
    assert set(found.rel_mse_zones) == {"inner", "middle"}
    for picture in (found.relative_error, found.flip_map, relative_noise_map(reference)):
        np.testing.assert_array_equal(np.isfinite(picture), INSIDE & ~rim)


def test_texels_of_half_coverage_are_judged():
    coverage, rim = rim_of(0.5)
    candidate = smooth_map()
    candidate[rim] *= 2
    found = compare(candidate, Reference(np.stack([smooth_map()] * 8), coverage, 64, 1.0), EXPOSURES)
    assert np.isfinite(found.relative_error).sum() == INSIDE.sum()
    assert found.rel_mse_zones["rim"].value > 0.9


def test_energy_goes_with_the_area_inside_the_disk():
    """Σ c a / Σ c b: a rim of half texels, twice too bright in a map of 1, adds half of its texels' number."""
    coverage, rim = rim_of(0.5)
    ones = np.ones((32, 32, 3), np.float32)
    candidate = np.where(rim[..., None], np.float32(2), ones)
    inner, outer = (INSIDE & ~rim).sum(), rim.sum()
    found = compare(candidate, Reference(np.stack([ones] * 8), coverage, 64, 1.0), EXPOSURES)
    assert found.energy_ratio == pytest.approx((inner + 0.5 * 2 * outer) / (inner + 0.5 * outer), rel=1e-12)


def test_the_noise_of_a_map_is_that_of_the_judged_texels():
    """Variance v over (b² + (b/10)²) of a map of constant b; texels of less than half coverage do not count."""
    coverage, rim = rim_of(0.49)
    radiance, variance = (np.full((32, 32, 3), value, np.float32) for value in (2.0, 0.01))
    radiance[rim], variance[rim] = 0.0, 100.0
    frame = np.eye(3)
    stored = MapFile(frame[:, 2], frame, {"radiance": radiance}, variance, coverage)
    assert map_noise(stored) == pytest.approx(0.01 / (2**2 * 1.01), rel=1e-6)


def test_moments_without_a_buffer_are_those_of_the_others(rng):
    """Mean and variance of the mean of the remaining buffers, by leaving each out in earnest."""
    buffers = rng.gamma(2.0, size=(6, 50, 3))
    for k, moments in enumerate(_Moments.leaving_out_each(buffers)):
        rest = np.delete(buffers, k, axis=0)
        np.testing.assert_allclose(moments.mean, rest.mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(moments.variance, rest.var(axis=0, ddof=1) / 5, rtol=1e-9)


def test_samples_and_buffers_are_debiased_both(rng):
    """Mean of 400 estimates of a truth of 0.01/1.01: within 4 standard errors, false alarms 6e-5.

    Left in, the samples' noise would add 0.25 % of b² (½ of it with 2 of 4 samples), the buffers' 0.05 %.
    """
    samples = 1.1 + 0.1 * rng.standard_normal((400, 4, 64, 3))
    buffers = 1.0 + 0.0632 * rng.standard_normal((400, 8, 64, 3))
    found = [relative_mse_of_samples(*one) for one in zip(samples, buffers, strict=True)]
    values = np.array([estimate.value for estimate in found])
    error = values.std(ddof=1) / np.sqrt(len(values))
    assert abs(values.mean() - 0.01 / 1.01) < 4 * error
    # The jackknife's standard errors are those seen, or up to a tenth larger; 400 runs know the spread to 3.5 %
    told = np.sqrt(np.mean([estimate.standard_error**2 for estimate in found]))
    assert 0.86 < told / values.std(ddof=1) < 1.25
