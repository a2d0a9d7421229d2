"""Every preset under a real sky: the bake against the path tracer, by texel, by block and as a whole.

`tests/baking/test_integrator.py` does the same by texel and as a whole under four smooth lights.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from rsibr.baking.blocks import block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import PRESETS, load_material
from rsibr.validation.reference import render_reference
from tests.statistics.comparison import Comparison, compared
from tests.statistics.failures import kept_on_failure

N = 32
BLOCKS = 16
LEVEL = 1e-4
"""False-alarm rate of each of the three tests of each preset."""


def difference_of(environment, preset, samples, view, scale=None) -> tuple[Comparison, dict]:
    """Bake and path-trace one view; `scale` (H, W) makes the bake wrong on purpose."""
    material = load_material(MaterialConfig(preset=preset))
    frame = view_frame(view)
    integrator = SphereIntegrator(environment.emitter(), material.bsdf(), N)
    baked = bake_view(integrator, frame, block_sizes(samples), seed=11, index=0)
    reference = render_reference(environment, material, frame, N, samples, seed=12, buffers=BLOCKS)
    image = np.sum(list(baked.layers.values()), axis=0) * (1 if scale is None else scale[..., None])
    judged = baked.coverage > 0.99  # at the rim the camera's own coverage is noisy
    found = compared(image, baked.variance, reference.mean, reference.variance_of_mean, judged, BLOCKS - 1)
    variance = baked.variance + reference.variance_of_mean
    pictures = {"image": image, "reference": reference.mean, "variance": variance, "p_values": found.p_values}
    return found, pictures


@pytest.fixture(scope="module")
def courtyard():
    return load_environment(EnvironmentConfig(file=scenes() / "environments" / "courtyard.exr"))


@pytest.mark.parametrize("preset", PRESETS)
def test_bake_agrees_with_the_path_tracer_under_a_real_sky(preset, courtyard):
    """False-alarm rate 1e-4 for each of texels, blocks and aggregate, Šidák's correction included.

    1024 samples in blocks: the t-test takes their means for Gaussian, which a sun seen by few samples is not;
    the courtyard's brightest texels are a window, and the blocks' means are near enough.
    """
    found, pictures = difference_of(courtyard, preset, 1024, [0.2, 0.5, 0.8])
    with kept_on_failure(f"reference_{preset}", **pictures):
        assert min(found.texel, found.block, found.aggregate) > LEVEL


@pytest.mark.slow
@pytest.mark.parametrize("environment", ["city", "courtyard", "studio", "sunset"])
@pytest.mark.parametrize("preset", PRESETS)
def test_bake_agrees_with_the_path_tracer_under_every_sky(preset, environment):
    """The same from below, with 16 times the samples, under all maps of rsibr: false-alarm rate 1e-4 each."""
    sky = load_environment(EnvironmentConfig(file=scenes() / "environments" / f"{environment}.exr"))
    found, pictures = difference_of(sky, preset, 2**14, [-0.5, -0.3, 0.6])
    with kept_on_failure(f"reference_{preset}_{environment}", **pictures):
        assert min(found.texel, found.block, found.aggregate) > LEVEL


def test_a_bias_that_changes_its_sign_is_seen_by_the_blocks_alone(courtyard):
    """± 2.5 % in a chequerboard of 4 × 4 texels: no texel and no aggregate shows it, the blocks do."""
    cell = np.arange(N) // 4
    scale = 1 + 0.025 * np.where((cell[:, None] + cell) % 2, 1, -1)
    found, _ = difference_of(courtyard, "matte-lambert", 1024, [0.2, 0.5, 0.8], scale)
    assert found.block < LEVEL
    assert found.aggregate > LEVEL


def test_a_small_bias_everywhere_is_seen_by_the_aggregate(courtyard):
    found, _ = difference_of(courtyard, "matte-lambert", 1024, [0.2, 0.5, 0.8], np.full((N, N), 1.005))
    assert found.aggregate < LEVEL


def simulated(rng, bias=0.0):
    truth = 1 + rng.random((N, N, 3))
    noise = 0.05 * rng.standard_normal((2, BLOCKS, N, N, 3)) * np.sqrt(BLOCKS)
    a, b = truth + noise[0].mean(0) + bias, truth + noise[1].mean(0)
    variances = noise.var(axis=1, ddof=1) / BLOCKS
    return compared(a, variances[0], b, variances[1], np.ones((N, N), bool), BLOCKS - 1)


def test_false_alarms_are_as_rare_as_stated(rng):
    """Of 400 comparisons of equal maps: the aggregate's p is uniform, the others' no smaller than uniform, at 1e-4."""
    found = [simulated(rng) for _ in range(400)]
    assert kstest([each.aggregate for each in found], "uniform").pvalue > 1e-4
    for name in ("texel", "block"):
        assert kstest([getattr(each, name) for each in found], "uniform", alternative="greater").pvalue > 1e-4


def test_one_wrong_texel_is_seen_by_the_texels(rng):
    bias = np.zeros((N, N, 3))
    bias[7, 9] = 1.0
    assert simulated(rng, bias).texel < LEVEL


def test_what_failed_is_kept(tmp_path):
    import OpenEXR

    image = np.arange(48, dtype=np.float32).reshape(4, 4, 3)

    def fail():
        with kept_on_failure("a test [x/y]", tmp_path, image=image, p_values=image[..., 0]):
            raise AssertionError

    with pytest.raises(AssertionError) as failed:
        fail()
    path = tmp_path / "a_test_x_y_.exr"
    assert failed.value.__notes__ == [f"image, reference, variance and p-values: {path}"]
    with OpenEXR.File(str(path)) as file:
        assert [part.name() for part in file.parts] == ["image", "p_values"]
        assert np.array_equal(file.parts[0].channels["RGB"].pixels, image)
