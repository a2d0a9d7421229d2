"""Equal relMSE: the bake's estimator against a plain `mi.render` with `path` and the `independent` sampler."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.bake.integrator import SphereIntegrator
from rsibr.geometry.frame import view_frame
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material

N = 128
SAMPLES = 64
RUNS = 24
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
def test_time_to_equal_rel_mse(benchmark, scene):
    """`extra_info.time_ratio`: seconds × relMSE of the bake over that of the plain render. Below 1/3 is wanted."""
    environment, material, name = scene
    integrator = SphereIntegrator(environment.emitter(), material.bsdf(), N)
    inside = integrator.coverage == 1
    seeds = iter(range(10_000))
    images = []

    def ours():
        images.append(
            integrator.image(
                integrator.block(view_frame([1, 2, 3]), SAMPLES, np.random.SeedSequence(next(seeds)))[:, 0]
            )
        )

    benchmark.pedantic(ours, rounds=RUNS, warmup_rounds=1)
    plain_images, plain_seconds = _plain(environment, material)
    ratio = relative_variance(images[1:], inside) * benchmark.stats.stats.median
    ratio /= relative_variance(plain_images, inside) * plain_seconds
    benchmark.extra_info.update(material=name, time_ratio=ratio, rel_mse=relative_variance(images[1:], inside))
    print(f"\n{name}: time to equal relMSE {ratio:.3f} of plain mi.render")  # noqa: T201


def _plain(environment, material):
    """The same view through the plainest Mitsuba scene: images, and the median seconds of one."""
    from time import perf_counter

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
