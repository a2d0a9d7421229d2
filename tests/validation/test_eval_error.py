"""`eval` is judged by random points of each texel: unbiased, whatever varies within the texel, and it finds errors."""

import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.methods import PointwiseMethod
from rsibr.validation.eval_error import POINTS, disk_points, judge_eval
from rsibr.validation.metrics import relative_mse_of_samples
from rsibr.validation.reference import Reference
from tests.arrays import disk_grid

N = 32
FRAME = view_frame([0.3, -0.5, 0.8])


class Striped(PointwiseMethod):
    """Radiance that changes by half within a texel, times a factor."""

    factor = 1.0

    def eval(self, n, v):
        import drjit as dr
        import mitsuba as mi

        return mi.Color3f(self.factor * (1 + 0.5 * dr.sin(3 * N * n.x)))


def texel_means(fineness=32):
    """Mean of the same radiance over each texel's part of the disk, shape (N, N, 3), and the coverage."""
    x, y = disk_grid(N * fineness)
    inside = np.hypot(x, y) < 1
    height = np.sqrt(np.maximum(0, 1 - x * x - y * y))
    normal_x = np.stack([x, y, height], axis=-1) @ FRAME.T[:, 0]
    values = np.where(inside, 1 + 0.5 * np.sin(3 * N * normal_x), 0)

    def pooled(image):
        return image.reshape(N, fineness, N, fineness).mean(axis=(1, 3))

    coverage = pooled(inside.astype(float))
    return np.repeat((pooled(values) / np.maximum(coverage, 1e-9))[..., None], 3, axis=2), coverage


@pytest.fixture(scope="module")
def reference():
    """Eight buffers of 5 % noise around the exact means."""
    means, coverage = texel_means()
    noise = 0.05 * np.random.default_rng(1).standard_normal((8, N, N, 3))
    return Reference((means + noise).astype(np.float32), coverage.astype(np.float32), 8, 1.0)


def test_points_lie_in_their_texels_and_in_the_disk():
    texels = texel_means(8)[1] >= 0.5
    points = disk_points(texels, 3, np.random.default_rng(0))
    assert points.shape == (3 * texels.sum(), 2)
    assert (np.hypot(*points.T) < 1).all()
    row, column = np.nonzero(texels)
    for each in points.reshape(3, -1, 2):
        assert np.array_equal(np.floor((each[:, 0] + 1) / 2 * N), column)
        assert np.array_equal(np.floor((1 - each[:, 1]) / 2 * N), row)
    within = (points + 1) / 2 * N % 1
    assert np.abs(within.mean(axis=0) - 0.5).max() < 5 * np.sqrt(1 / 12 / len(points))  # false alarms: 1e-6


def test_what_is_right_has_no_error_however_it_varies_within_a_texel(reference):
    """The scatter of the points alone would be an error of 0.03. False alarms by Student's t over 20 seeds: 8e-5."""
    found = [judge_eval(Striped(None), FRAME, reference, seed=seed).rel_mse for seed in range(20)]
    values = np.array([error.value for error in found])
    assert abs(values.mean()) < 5 * values.std(ddof=1) / np.sqrt(20) < 0.003
    assert np.mean([error.standard_error for error in found]) > 0.5 * values.std(ddof=1)


def test_what_is_off_by_a_tenth_errs_by_a_hundredth(reference):
    method = Striped(None)
    method.factor = 1.1
    assert method.cost.lookup_seconds is None
    judged = judge_eval(method, FRAME, reference, seed=3)
    error = judged.rel_mse
    assert error.value == pytest.approx(0.01, abs=5 * error.standard_error)
    assert not error.below_noise_floor
    assert method.cost.lookup_seconds == judged.seconds > 0  # the cost keeps what was measured


def test_the_mean_of_few_samples_is_debiased(rng):
    """100 times: the mean over all lies within five of its standard errors (false alarms: 6e-7)."""
    truth = rng.gamma(2.0, 1.0, (4000, 3))
    found = [
        relative_mse_of_samples(
            1.1 * truth + 0.3 * rng.standard_normal((POINTS, *truth.shape)),
            truth + 0.1 * rng.standard_normal((8, *truth.shape)),
        ).value
        for _ in range(100)
    ]
    exact = float(((0.1 * truth) ** 2 / (truth**2 + (0.1 * truth.mean(axis=0)) ** 2)).mean())
    assert abs(np.mean(found) - exact) < 5 * np.std(found) / np.sqrt(len(found)) < 0.1 * exact


def test_points_are_judged_where_maps_are(reference):
    """Whatever the reference holds in texels of less than half coverage."""
    rim = (reference.coverage > 0) & (reference.coverage < 0.5)
    assert rim.any()
    buffers = reference.buffers.copy()
    buffers[:, rim] = 1e3
    spoilt = Reference(buffers, reference.coverage, 8, 1.0)
    plain, other = (judge_eval(Striped(None), FRAME, one, seed=3).rel_mse for one in (reference, spoilt))
    assert other == plain
