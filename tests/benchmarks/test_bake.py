"""A bake against a plain `mi.render` with `path` and the `independent` sampler: at equal relMSE, and by the sample."""

from time import perf_counter

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.sampling import Sampler
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig, MaterialConfig, SamplingConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material

N = 256
TARGET = 1e-3
SAMPLES = 64
RUNS = 12
MATERIALS = ["clearcoat-red", "glossy-plastic", "rough-aluminium", "matte-lambert"]


def relative_variance(images, judged):
    """Mean relative variance of one image, over texels and channels: its relMSE, for both are unbiased."""
    images = np.asarray(images, dtype=np.float64)[:, judged]
    mean = images.mean(axis=0)
    return float((images.var(axis=0, ddof=1) / (mean**2 + (0.1 * mean.mean(axis=0)) ** 2)).mean())


@pytest.fixture(scope="module", params=MATERIALS)
def scene(request):
    """Material and environment."""
    environment = load_environment(EnvironmentConfig(file=scenes() / "environments" / "city.exr"))
    return environment, load_material(MaterialConfig(preset=request.param)), request.param


@pytest.mark.benchmark(group="bake")
def test_time_to_a_promised_rel_mse(benchmark, scene):
    """`extra_info.time_ratio`: seconds × relMSE of a baked view over that of the plain render. 1/5 or less is wanted.

    The bake is asked for `TARGET` and finds out by itself how many samples that takes, and where: pilots included.
    """
    environment, material, name = scene
    integrator = SphereIntegrator(environment.emitter(), material.bsdf(), N)
    frame, seeds, images = view_frame([1, 2, 3]), iter(range(10_000)), []

    def ours():
        sampling = SamplingConfig(target_error=TARGET, seed=next(seeds))
        sampler = Sampler(integrator, [frame], sampling)
        blocks = sampler.blocks(sampler.choose(perf_counter()), 0)
        images.append(bake_view(integrator, frame, blocks, seed=sampling.seed, index=0).radiance)

    benchmark.pedantic(ours, rounds=RUNS, warmup_rounds=1)
    inside = integrator.coverage == 1
    reached = relative_variance(images[1:], inside)
    plain_images, plain_seconds = _plain(environment, material)
    plain_work = relative_variance(plain_images, inside) * plain_seconds
    ratio = reached * benchmark.stats.stats.median / plain_work
    benchmark.extra_info.update(material=name, time_ratio=ratio, rel_mse=reached)
    print(f"\n{name}: asked for {TARGET:g}, reached {reached:.2g} in {ratio:.3f} of plain mi.render's time")  # noqa: T201


@pytest.mark.benchmark(group="bake")
def test_time_of_a_sample_and_to_equal_rel_mse(benchmark, scene):
    """A block of the estimator against as many samples of `path`: each looks in two directions, at light and material.

    `extra_info.time_ratio`: seconds × relMSE over the plain render's, below 1/3 is wanted; `ratio`: of the seconds.
    """
    environment, material, name = scene
    integrator = SphereIntegrator(environment.emitter(), material.bsdf(), N)
    texels, seeds, images = int((integrator.coverage > 0).sum()), iter(range(10_000)), []

    def ours():
        block = integrator.block(view_frame([1, 2, 3]), SAMPLES, np.random.SeedSequence(next(seeds)))
        images.append(integrator.image(block[:, 0]))

    benchmark.pedantic(ours, rounds=RUNS, warmup_rounds=1)
    plain_images, plain_seconds = _plain(environment, material)
    inside = integrator.coverage == 1
    seconds = benchmark.stats.stats.median / plain_seconds
    equal = seconds * relative_variance(images[1:], inside) / relative_variance(plain_images, inside)
    a_sample = 1e9 * benchmark.stats.stats.median / (texels * SAMPLES)
    benchmark.extra_info.update(material=name, nanoseconds=a_sample, ratio=seconds, time_ratio=equal)
    told = f"{a_sample:.0f} ns a sample, {seconds:.2f} of plain mi.render's; to equal relMSE {equal:.3f} of its time"
    print(f"\n{name}: {told}")  # noqa: T201


def _plain(environment, material):
    """The same view through the plainest Mitsuba scene: images, and the median seconds of one."""
    camera = view_frame([1, 2, 3])
    scene = mi.load_dict({
        "type": "scene", "light": environment.emitter(), "sphere": {"type": "sphere", "material": material.bsdf()},
        "integrator": {"type": "path"},
        "sensor": {
            "type": "orthographic",
            "to_world": mi.ScalarTransform4f().look_at(list(camera[:, 2] * 3), [0, 0, 0], list(camera[:, 1])),
            "film": {"type": "hdrfilm", "width": N, "height": N, "rfilter": {"type": "box"}, "pixel_format": "rgb",
                     "component_format": "float32"},
            "sampler": {"type": "independent"},
        },
    })  # fmt: skip
    images, seconds = [], []
    for seed in range(RUNS + 1):
        start = perf_counter()
        image = mi.render(scene, spp=SAMPLES, seed=seed)
        dr.eval(image)
        dr.sync_thread()
        seconds.append(perf_counter() - start)
        images.append(np.array(image))
    return images[1:], float(np.median(seconds[1:]))
