"""The reference against closed forms that share no code with it."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student_t

from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.validation.reference import ReferenceRenderer, render_reference, stratified
from tests.validation.doubles import BLACK_SKY, GREY_SKY, LAMBERT, MIRROR, Sky, slanted_sky

VIEWS = [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0.3, -0.5, -0.8), (-0.7, 0.6, 0.2)]


@pytest.fixture(scope="module")
def mirror_under_slanted_sky():
    return ReferenceRenderer(slanted_sky(), MIRROR, 32)


def normals(frame, resolution):
    """World normals at the texel centres, row 0 at the top, and where they lie inside the disk by a margin."""
    centre = (np.arange(resolution) + 0.5) * 2 / resolution - 1
    x, y = np.meshgrid(centre, -centre)
    inside = np.hypot(x, y) < 0.95
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    return np.stack([x, y, z], axis=-1) @ np.asarray(frame).T, inside


@pytest.mark.parametrize("view", VIEWS)
def test_a_mirror_shows_the_sky_upright_and_not_mirrored(mirror_under_slanted_sky, view):
    frame = view_frame(view)
    n, inside = normals(frame, 32)
    v = frame[:, 2]
    r = 2 * (n @ v)[..., None] * n - v
    image = mirror_under_slanted_sky.render(frame, samples=128).mean
    # A texel is the mean over its area, where this takes its centre: the reflection turns by up to 0.2 rad inside one.
    assert np.abs(image - (1 + r / 2))[inside].max() < 0.02


def test_a_frame_may_be_turned_about_the_view(mirror_under_slanted_sky):
    upright = view_frame((0, 0, 1))
    turned = upright @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # x ← y: the picture turns by a quarter clockwise
    images = [mirror_under_slanted_sky.render(frame, samples=512).mean for frame in (upright, turned)]
    _, inside = normals(upright, 32)
    assert np.abs(np.rot90(images[0], -1) - images[1])[inside].max() < 0.02


def test_white_furnace_divides_coverage_out_to_the_rim():
    reference = render_reference(GREY_SKY, MIRROR, view_frame((1, 2, 3)), 32, samples=128)
    covered = reference.coverage > 0
    np.testing.assert_allclose(reference.mean[covered], np.broadcast_to([1, 2, 0.5], (covered.sum(), 3)), rtol=1e-5)
    assert (reference.buffers[:, ~covered] == 0).all()
    np.testing.assert_allclose(reference.coverage, texel_coverage(32), atol=0.1)


def test_lambert_under_a_linear_sky_passes_per_texel_and_in_the_mean():
    # Irradiance of 1 + d·c/2 is π(1 + n·c/3), so the radiance is albedo (1 + n·c/3), here its mean over each texel.
    # False alarms: 1e-3 for the largest of all texels and channels (Šidák), 1e-3 for each channel's aggregate.
    frame = view_frame((0.4, 0.5, -0.6))
    reference = render_reference(slanted_sky(), LAMBERT, frame, 32, samples=2048, seed=3, buffers=64)
    n, inside = normals(frame, 32 * 8)
    n, inside = (a.reshape(32, 8, 32, 8, -1).mean(axis=(1, 3)) for a in (n, inside))
    inside = inside[..., 0] == 1
    error = (reference.mean - np.array([0.8, 0.5, 0.2]) * (1 + n / 3))[inside]
    variance = reference.variance_of_mean[inside]
    largest = np.abs(error / np.sqrt(variance)).max()
    assert largest < student_t.isf(-np.expm1(np.log1p(-1e-3) / error.size) / 2, df=63)
    assert (np.abs(error.sum(axis=0) / np.sqrt(variance.sum(axis=0))) < norm.isf(0.5e-3)).all()


def test_the_spread_of_the_buffers_is_the_noise():
    # Variance that 8 buffers predict against that among 16 whole references. 200 texels (their channels go together) of
    # 15 degrees of freedom: the ratio's standard error is sqrt(2/15/200) = 0.026; 3.5 of them: false alarms 5e-4.
    renderer = ReferenceRenderer(slanted_sky(64), LAMBERT, 16)
    references = [renderer.render(view_frame((0, 0, 1)), samples=128, seed=seed) for seed in range(16)]
    inside = references[0].coverage >= 0.5
    predicted = np.mean([reference.variance_of_mean[inside].mean() for reference in references])
    seen = np.var([reference.mean[inside] for reference in references], axis=0, ddof=1).mean()
    assert seen / predicted == pytest.approx(1.0, abs=0.09)


def test_black_environment_gives_a_black_map():
    reference = render_reference(BLACK_SKY, LAMBERT, view_frame((0, 1, 0)), 16, samples=16)
    assert (reference.buffers == 0).all()
    assert (reference.coverage[4:12, 4:12] == 1).all()


def test_same_seed_same_bits_other_seed_other_bits(mirror_under_slanted_sky):
    frame = view_frame((0, 0, 1))
    one, same, other = (mirror_under_slanted_sky.render(frame, 64, seed=seed).buffers for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, same)
    assert (one != other).mean() > 0.1
    assert len({buffer.tobytes() for buffer in one}) == 8


def test_two_views_share_no_random_numbers():
    renderer = ReferenceRenderer(GREY_SKY, LAMBERT, 16)  # the same map from everywhere but for noise
    front, back = (renderer.render(view_frame(view), 64).mean for view in ((0, 0, 1), (0, 0, -1)))
    assert (front != back).any()


def test_a_second_view_compiles_nothing():
    renderer = ReferenceRenderer(slanted_sky(64), LAMBERT, 16)
    first = renderer.render(view_frame((0, 0, 1)), 64)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        second = renderer.render(view_frame((1, 0.5, 0)), 64, seed=5)
        history = dr.kernel_history([dr.KernelType.JIT])
    assert history
    assert all(entry["cache_hit"] for entry in history)
    assert first.compile_seconds > 0
    assert second.compile_seconds == 0


def test_seconds_hold_the_work_and_not_the_compilation(mirror_under_slanted_sky):
    frame = view_frame((0, 0, 1))
    few = min(mirror_under_slanted_sky.render(frame, 8 * 4).seconds for _ in range(3))
    many = mirror_under_slanted_sky.render(frame, 8 * 1024).seconds
    assert many > 4 * few


@pytest.mark.parametrize(("samples", "buffers"), [(100, 4), (4, 8)])
def test_too_few_buffers_or_samples_are_refused(mirror_under_slanted_sky, samples, buffers):
    with pytest.raises(InputError, match="buffers"):
        mirror_under_slanted_sky.render(view_frame((0, 0, 1)), samples, buffers=buffers)


@pytest.mark.parametrize("samples", [8, 100, 999, 4096])
def test_no_fewer_samples_than_asked_for(mirror_under_slanted_sky, samples, capfd):
    taken = mirror_under_slanted_sky.render(view_frame((0, 0, 1)), samples).samples
    assert samples <= taken <= 2 * samples
    assert "rounded" not in capfd.readouterr().out


@pytest.mark.parametrize("samples", [1, 2, 3, 5, 7, 13, 16, 100, 1000])
def test_stratified_counts_are_those_that_mitsuba_does_not_round(samples):
    count = stratified(samples)
    assert samples <= count <= samples + np.sqrt(samples)
    assert mi.load_dict({"type": "multijitter", "sample_count": count}).sample_count() == count


def test_many_passes_are_one_buffer():
    sky = Sky({"type": "constant", "radiance": {"type": "rgb", "value": 3.0}})
    renderer = ReferenceRenderer(sky, MIRROR, 16, max_lanes=16 * 16 * 4)
    reference = renderer.render(view_frame((0, 0, 1)), samples=128)
    assert reference.samples == 128
    np.testing.assert_allclose(reference.mean[8, 8], 3.0, rtol=1e-6)
    assert reference.coverage[8, 8] == 1
    np.testing.assert_allclose(reference.coverage, texel_coverage(16), atol=0.1)
