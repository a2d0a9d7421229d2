"""Adaptive samples and promises: unbiased, with the right variance, decided once, kept when resumed."""

import time
from dataclasses import replace
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from rsibr.baking import sampling
from rsibr.baking.baker import bake as bake_config
from rsibr.baking.blocks import MAX_BLOCKS, Blocks, block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.sampling import Sampler, Steering
from rsibr.baking.view import bake_view
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.scene.config import SamplingConfig
from rsibr.store.manifest import SamplingRecord, read_manifest
from rsibr.store.noise import map_noise
from tests.arrays import unit_vectors
from tests.planning.scenes import sun

N = 24
RUNS = 48
FALSE_ALARM = 1e-4

CONFIG = """
[environment]
file = "{environment}"
[material]
bsdf = {{type = "roughconductor", alpha = 0.3, material = "none"}}
[map]
resolution = 24
[sampling]
seed = 7
"""


ALWAYS = Steering(worth_it=1.0, least_work=0, few_blocks=MAX_BLOCKS)
"""Allocates samples in bakes that are too small for it to pay."""

bake = partial(bake_config, steering=ALWAYS)


@pytest.fixture
def config(tmp_path, asymmetric_environment):
    path = tmp_path / "small.toml"
    path.write_text(CONFIG.format(environment=asymmetric_environment))
    return path


@pytest.fixture(scope="module")
def integrator():
    """A glossy metal under a sun: a bright spot on a dark map."""
    return SphereIntegrator(sun().emitter(), mi.load_dict({"type": "roughconductor", "alpha": 0.15}), N)


def adaptive(integrator, frame, seed):
    """Bake one view by a sampler of its own; its map, and the blocks of its texels."""
    sampler = Sampler(integrator, [frame], SamplingConfig(samples=64, seed=seed), ALWAYS)
    blocks = sampler.blocks(sampler.choose(time.perf_counter()), 0)
    return bake_view(integrator, frame, blocks, seed=seed, index=0), blocks


@pytest.fixture(scope="module")
def runs(integrator):
    """Many adaptive bakes of a view: mean radiance, variances, and block counts of the covered texels."""
    made = [adaptive(integrator, view_frame([1, 2, 3]), seed) for seed in range(RUNS)]
    inside = integrator.coverage > 0
    means = np.array([stored.radiance[inside] for stored, _ in made], np.float64)
    variances = np.array([stored.variance[inside] for stored, _ in made], np.float64)
    return means, variances, np.array([blocks.counts for _, blocks in made])


def test_counts_follow_the_noise(runs):
    _, variances, counts = runs
    assert counts.max() >= 3 * counts.min()
    spread = (variances * counts[..., None]).mean(axis=(0, 2))
    noisy, quiet = spread > np.quantile(spread, 0.9), spread < np.quantile(spread, 0.1)
    assert counts[:, noisy].mean() > 1.5 * counts[:, quiet].mean()


def test_mean_of_many_adaptive_bakes_is_that_of_a_long_even_one(integrator, runs):
    """Per texel, Welch's t with the lesser degrees of freedom and Šidák's bound; and Σz. False-alarm rate 1e-4 each.

    The counts of a run are fixed by its pilot, whose samples are in no mean: no rule stops at what it likes.
    """
    means, _, _ = runs
    inside = integrator.coverage > 0
    long = bake_view(integrator, view_frame([1, 2, 3]), block_sizes(32768), seed=999, index=1)
    difference = means.mean(axis=0) - long.radiance[inside]
    error = np.sqrt(means.var(axis=0, ddof=1) / RUNS + long.variance[inside])
    z = (difference / error).mean(axis=1)  # the channels share their samples: one number a texel
    assert 2 * student.sf(np.abs(z).max(), MAX_BLOCKS - 1) > 1 - (1 - FALSE_ALARM) ** (1 / len(z))
    assert 2 * norm.sf(abs(z.sum() / np.sqrt((z**2).sum()))) > FALSE_ALARM


def test_stored_variance_is_what_the_runs_show(runs):
    """Estimated against empirical variance of the mean, summed over texels; 4.5 σ by a bootstrap over texels: 7e-6."""
    means, variances, _ = runs
    seen, estimated = means.var(axis=0, ddof=1).sum(axis=1), variances.mean(axis=0).sum(axis=1)
    weight = 1 / (estimated + estimated.mean())
    ratio = (seen * weight).sum() / (estimated * weight).sum()
    generator = np.random.default_rng(4)
    picks = generator.integers(len(seen), size=(400, len(seen)))
    scatter = ((seen * weight)[picks].sum(axis=1) / (estimated * weight)[picks].sum(axis=1)).std()
    assert abs(ratio - 1) < 4.5 * scatter
    assert scatter < 0.05


def test_equal_work_makes_less_noise(integrator, runs):
    """In the mean over the runs, by their stored variances; the gain here is some 20 %."""
    frame = view_frame([1, 2, 3])
    even = [map_noise(bake_view(integrator, frame, Blocks(8, 8), seed=seed, index=0)) for seed in range(RUNS)]
    made = [map_noise(adaptive(integrator, frame, seed)[0]) for seed in range(RUNS)]
    assert np.mean(made) < 0.9 * np.mean(even)
    assert runs[2].mean() == pytest.approx(8, rel=0.05)


def test_views_with_more_noise_get_more():
    coated = mi.load_dict({"type": "principled", "roughness": 0.3, "clearcoat": 1.0})
    integrator = SphereIntegrator(sun().emitter(), coated, N)
    frames = [view_frame(view) for view in ([0, 0, 1], [0, -1, 0], [0, 1, 0], [1, 0, 0])]
    sampler = Sampler(integrator, frames, SamplingConfig(samples=64), ALWAYS)
    record = sampler.choose(time.perf_counter())
    work = [sampler.blocks(record, index).counts.mean() for index in range(len(frames))]
    noise = [map_noise(bake_view(integrator, frame, Blocks(8, 8), seed=1, index=0)) for frame in frames]
    assert np.argsort(work).tolist() == np.argsort(noise).tolist()
    assert np.mean(work) == pytest.approx(8, rel=0.05)


def test_nothing_is_compiled_from_view_to_view(integrator, rng):
    """Pilots included, though their maps are smaller, and whatever the counts are."""
    frames = [view_frame(view) for view in unit_vectors(rng, 4)]
    adaptive(integrator, view_frame([3, 2, 1]), 5)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        counts = [adaptive(integrator, frame, seed)[1].counts.sum() for seed, frame in enumerate(frames)]
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert len(set(counts)) > 1
    assert launched
    assert all(kernel["cache_hit"] for kernel in launched)


def map_bytes(path):
    return {file.name: file.read_bytes() for file in sorted((path / "maps").iterdir())}


@pytest.mark.parametrize(
    "key", ["samples=64", "target_error=0.003", pytest.param("time_budget_s=8", marks=pytest.mark.slow)]
)
def test_resumed_it_ends_bit_identical_and_decides_nothing_anew(config, tmp_path, monkeypatch, key):
    whole = bake(config, out=tmp_path / "b.rsibr", overrides=[f"sampling.{key}"])
    kept, record = map_bytes(whole.path), whole.manifest.sampling
    assert record.scale is not None
    for index in (0, 5, 11):
        (whole.path / "maps" / f"view_{index:04d}.exr").unlink()
    monkeypatch.setattr(Sampler, "choose", lambda *_: pytest.fail("decided anew"))
    again = bake(config, out=whole.path, overrides=[f"sampling.{key}"])
    assert map_bytes(again.path) == kept
    assert read_manifest(again.path / "manifest.json").sampling == record


def test_a_target_is_promised_and_reached(config, tmp_path):
    for target in (0.01, 0.001):
        overrides = [f"sampling.target_error={target}"]
        manifest = bake(config, out=tmp_path / f"{target}.rsibr", overrides=overrides).manifest
        assert manifest.sampling.promised_rel_mse == target
        assert manifest.noise <= target
        assert manifest.noise == pytest.approx(np.mean([state.noise for state in manifest.views]))


def test_a_time_is_promised_and_told(config, tmp_path):
    manifest = bake(config, out=tmp_path / "b.rsibr", overrides=["sampling.time_budget_s=3"]).manifest
    assert manifest.sampling.promised_seconds == 3
    assert manifest.total_seconds == pytest.approx(manifest.seconds + manifest.sampling.seconds)
    assert manifest.sampling.samples >= 4


@pytest.mark.parametrize(
    ("key", "said"),
    [("target_error=1e-12", "the best that .* can promise"), ("time_budget_s=0.001", "too few for 12 maps of 24²")],
)
def test_what_cannot_be_promised_is_refused_in_one_line(config, tmp_path, key, said):
    with pytest.raises(InputError, match=said) as refused:
        bake(config, out=tmp_path / "b.rsibr", overrides=[f"sampling.{key}"])
    assert "\n" not in str(refused.value)


def test_without_adaptivity_every_texel_has_as_many(config, tmp_path):
    manifest = bake(
        config, out=tmp_path / "b.rsibr", overrides=["sampling.samples=64", "sampling.adaptive=false"]
    ).manifest
    assert (manifest.sampling.scale, manifest.sampling.gain, manifest.samples) == (None, None, 64)


def test_where_it_is_not_worth_it_samples_are_even(config, tmp_path):
    never = replace(ALWAYS, worth_it=1e9)
    manifest = bake(config, out=tmp_path / "b.rsibr", overrides=["sampling.samples=64"], steering=never).manifest
    assert manifest.sampling.scale is None
    assert manifest.sampling.gain > 1


@pytest.mark.parametrize(("block", "even"), [(8, 4), (32, 2), (3, 16)])
def test_noise_is_inversely_proportional_to_all_samples_of_a_texel(block, even):
    """Half the noise takes twice the samples, of all its blocks."""
    record = SamplingRecord(block=block, even=even, forecast_rel_mse=0.02)
    assert sampling._needed(record, 0.02) == block * even
    assert sampling._needed(record, 0.01) == 2 * block * even
