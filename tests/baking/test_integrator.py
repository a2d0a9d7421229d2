"""The estimator against closed forms and against Mitsuba's own path tracer."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from rsibr.baking.blocks import Blocks, BlockSums, block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.lattice import MAX_POINTS
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import LEAST_COVERAGE, texel_coverage
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import PRESETS, load_material
from rsibr.validation.reference import render_reference
from tests.arrays import disk_grid, unit_vectors

N = 32
FURNACE = {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
POLES_AND_MORE = [[0, 1, 0], [0, -1, 0], [1, 0, 0], [0, 0, 1], [-0.4, 0.3, -0.8], [0.6, -0.7, 0.2]]


def disk_area_moments(corner, step, count=64):
    """Centroid x, y of each texel's part inside the disk, by midpoint sums."""
    u = (np.arange(count) + 0.5) / count * step
    x, y = corner[0][..., None, None] + u[:, None], corner[1][..., None, None] - u[None, :]
    inside = np.hypot(x, y) < 1
    weight = np.maximum(inside.sum((-1, -2)), 1)
    z = np.sqrt(np.maximum(0, 1 - x * x - y * y))
    return tuple((value * inside).sum((-1, -2)) / weight for value in (x * np.ones_like(y), y * np.ones_like(x), z))


def test_white_furnace_of_a_perfect_mirror():
    """Hard case 16: every texel is 1, the rim's too, for any sample count."""
    integrator = SphereIntegrator(FURNACE, mi.load_dict({"type": "conductor", "material": "none"}), 64)
    for samples in (1, 5, 16):
        means = integrator.block(view_frame([1, 2, 3]), samples, np.random.SeedSequence(samples))
        assert np.abs(means - 1).max() < 1e-5


def test_coverage_is_exact_but_for_slivers():
    integrator = SphereIntegrator(FURNACE, mi.load_dict({"type": "diffuse"}), 64)
    exact = texel_coverage(64)
    assert np.abs(integrator.coverage - exact)[exact >= LEAST_COVERAGE].max() < 1e-7
    assert (integrator.coverage[exact < LEAST_COVERAGE] == 0).all()


def test_lambert_under_a_gradient_sky_is_unbiased(gradient_sky, gradient_axis):
    """Hard case 18: radiance (ρ/π)(π + (2π/3) a·n), by a per-texel test with Šidák's bound and an aggregate test.

    False-alarm rate 1e-4 each: 1 − (1 − 1e-4)^(1/texels) a texel, two-sided, Student's t with 15 degrees of freedom;
    and Σz/√texels against the normal distribution.
    """
    albedo = 0.5
    environment = load_environment(EnvironmentConfig(file=gradient_sky))
    integrator = SphereIntegrator(environment.emitter(), mi.load_dict({"type": "diffuse", "reflectance": albedo}), N)
    frame = view_frame([0.5, 0.6, -0.7])
    baked = bake_view(integrator, frame, Blocks(64, 16), seed=3, index=0)
    x, y = disk_grid(N)
    half = 1 / N
    mean_normal = np.stack(disk_area_moments((x - half, y + half), 2 * half), axis=-1) @ frame.T
    exact = albedo * (1 + 2 / 3 * mean_normal @ gradient_axis)
    judged = baked.coverage > 0.05  # below, the midpoint sums err more than the noise
    mean, variance = baked.layers["radiance"][..., 0][judged], baked.variance[..., 0][judged]
    t = (mean - exact[judged]) / np.sqrt(variance)
    level = 1 - (1 - 1e-4) ** (1 / len(t))
    assert 2 * student.sf(np.abs(t).max(), 15) > level
    assert 2 * norm.sf(abs(t.sum() / np.sqrt(len(t) * 15 / 13))) > 1e-4  # t₁₅ has the variance 15/13


@pytest.mark.parametrize("view", POLES_AND_MORE)
def test_orientation_is_mitsubas(view, asymmetric_environment):
    """Upright, not mirrored, not rolled: the mirror map under four coloured lights, against a real camera."""
    environment = load_environment(EnvironmentConfig(file=asymmetric_environment, rotation_deg=30))
    material = load_material(MaterialConfig(preset="mirror-silver"))
    frame = view_frame(view)
    integrator = SphereIntegrator(environment.emitter(), material.bsdf(), N)
    baked = bake_view(integrator, frame, block_sizes(64), seed=1, index=0).layers["radiance"]
    reference = render_reference(environment, material, frame, N, 128)
    judged = reference.coverage >= 0.5
    difference = np.abs(baked - reference.mean)[judged].mean()
    assert difference < 0.06 * reference.mean[judged].mean()
    for wrong in (baked[:, ::-1], baked[::-1], baked[::-1, ::-1], baked.swapaxes(0, 1)):
        assert np.abs(wrong - reference.mean)[judged].mean() > 5 * difference


@pytest.mark.parametrize("preset", PRESETS)
def test_bake_agrees_with_the_path_tracer(preset, asymmetric_environment):
    """Each preset: per-texel t-test with Šidák's bound and an aggregate z-test, false-alarm rate 1e-4 each.

    Two independent means with 7 degrees of freedom each: Welch's t with 7 is conservative.
    """
    environment = load_environment(EnvironmentConfig(file=asymmetric_environment))
    material = load_material(MaterialConfig(preset=preset))
    frame = view_frame([0.2, 0.5, 0.8])
    integrator = SphereIntegrator(environment.emitter(), material.bsdf(), N)
    baked = bake_view(integrator, frame, block_sizes(1024), seed=5, index=0)
    reference = render_reference(environment, material, frame, N, 1024)
    judged = baked.coverage > 0.99  # at the rim the camera's own coverage is noisy
    difference = (baked.layers["radiance"] - reference.mean)[judged]
    error = np.sqrt(baked.variance + reference.variance_of_mean)[judged] + 1e-6 * reference.mean[judged]
    t = difference / error
    assert 2 * student.sf(np.abs(t).max(), 7) > 1 - (1 - 1e-4) ** (1 / t.size)
    blocks = t.mean(axis=1)  # the channels share their samples: one number a texel
    assert 2 * norm.sf(abs(blocks.sum() / np.sqrt((blocks**2).sum()))) > 1e-4


def test_variance_of_the_mean_is_what_repeats_show():
    """The mean of the estimated variances against the spread over 40 bakes; 4 sigma: false-alarm rate 6e-5."""
    city = {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 2.0, 3.0]}}
    integrator = SphereIntegrator(city, mi.load_dict({"type": "roughconductor", "alpha": 0.3}), 16)
    runs = [bake_view(integrator, np.eye(3), block_sizes(64), seed=seed, index=0) for seed in range(40)]
    inside = integrator.coverage == 1
    estimated = np.mean([r.variance for r in runs], axis=0)[inside].sum(axis=0)
    seen = np.var([r.layers["radiance"] for r in runs], axis=0, ddof=1)[inside].sum(axis=0)
    spread = np.sqrt(2 / 39 / (inside.sum() / 4))  # texels differ in variance: a quarter of them count in effect
    assert np.abs(seen / estimated - 1).max() < 4 * spread


def test_sums_over_blocks_are_their_mean_and_the_variance_of_it(rng):
    """Counts differ from texel to texel, and a launch may end in the middle of one."""
    counts = rng.integers(2, 20, size=50)
    texels = np.repeat(np.arange(50), counts)
    means = rng.normal(3, 2, size=(len(texels), 2, 3)).astype(np.float32)
    sums = BlockSums(50, 2)
    for part in np.array_split(np.arange(len(texels)), 7):
        sums.add(texels[part], means[part])
    mean, variance = sums.result()
    for texel, count in enumerate(counts):
        own = means[texels == texel].astype(np.float64)
        assert np.allclose(mean[texel], own.mean(axis=0), rtol=1e-6)
        assert np.allclose(variance[texel], own.sum(axis=1).var(axis=0, ddof=1) / count, rtol=1e-5)


@pytest.mark.parametrize(
    ("samples", "size", "count"), [(4, 2, 2), (16, 4, 4), (64, 8, 8), (1000, 125, 8), (25 * MAX_POINTS, MAX_POINTS, 25)]
)
def test_blocks_hold_at_least_the_samples_asked_for(samples, size, count):
    blocks = block_sizes(samples)
    assert (blocks.size, blocks.counts) == (size, count)


def test_samples_are_spread_evenly_within_a_block(gradient_sky):
    """Under a smooth sky the variance of 64 samples of a block is a small part of that of 64 single ones."""
    light = load_environment(EnvironmentConfig(file=gradient_sky)).emitter()
    integrator = SphereIntegrator(light, mi.load_dict({"type": "diffuse"}), 16)

    def variance(samples, blocks):
        seeds = [np.random.SeedSequence(1, spawn_key=(block,)) for block in range(blocks)]
        means = [integrator.block(np.eye(3), samples, seed) for seed in seeds]
        return np.var(means, axis=0, ddof=1).mean()

    assert variance(64, 16) < 0.1 * variance(1, 64) / 64


def test_launches_of_a_block_are_split_to_bound_the_memory(monkeypatch):
    mirror = mi.load_dict({"type": "conductor", "material": "none"})
    integrator = SphereIntegrator(FURNACE, mirror, 16, max_lanes=1000)
    launched = []
    launch = integrator._launch
    monkeypatch.setattr(integrator, "_launch", lambda m, t, n, s: launched.append(n) or launch(m, t, n, s))
    means = integrator.block(np.eye(3), 13, np.random.SeedSequence(1))
    assert launched == [5, 5, 5]
    assert max(launched) * (integrator.coverage > 0).sum() < 2 * 1000
    assert np.abs(means - 1).max() < 1e-5


def test_nothing_is_compiled_from_view_to_view_or_from_bake_to_bake(asymmetric_environment, rng):
    def integrator(rotation):
        light = load_environment(EnvironmentConfig(file=asymmetric_environment, rotation_deg=rotation))
        return SphereIntegrator(light.emitter(), load_material(MaterialConfig(preset="glossy-plastic")).bsdf(), N)

    first, second = integrator(0), integrator(90)
    first.block(view_frame([1, 2, 3]), 16, np.random.SeedSequence(1))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for seed, view in enumerate(unit_vectors(rng, 4)):
            first.block(view_frame(view), 16, np.random.SeedSequence(seed))
        second.block(view_frame([3, 2, 1]), 16, np.random.SeedSequence(9))
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert launched
    assert all(kernel["cache_hit"] for kernel in launched)
