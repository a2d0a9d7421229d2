"""Equal relMSE: whole bakes whose samples go where the noise is, against even ones; the pilots' time counts."""

import time
from functools import partial

import numpy as np
import pytest

from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.sampling import Sampler
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import icosphere
from rsibr.lobes.split import LobeSplit
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig, MaterialConfig, SamplingConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.store.noise import map_noise

N = 128
SAMPLES = 256
ROUNDS = 3
SUN_LIT = [("courtyard", "rough-aluminium"), ("courtyard", "clearcoat-red"), ("sunset", "rough-aluminium"),
           ("sunset", "glossy-plastic")]  # fmt: skip
OTHERS = [("studio", "rough-aluminium"), ("studio", "clearcoat-red"), ("city", "clearcoat-red")]


def bake_all(integrator, adaptive, seed):
    """Noise of the maps of twelve views, the seconds that choosing and baking them took, and what was chosen."""
    frames = [view_frame(view) for view in icosphere(0).directions]
    start = time.process_time()  # of the processor: others' work is not in it
    sampler = Sampler(integrator, frames, SamplingConfig(samples=SAMPLES, adaptive=adaptive, seed=seed))
    record = sampler.choose(time.perf_counter())
    maps = [
        bake_view(integrator, frame, sampler.blocks(record, index), seed=seed, index=index)
        for index, frame in enumerate(frames)
    ]
    return float(np.mean([map_noise(one) for one in maps])), time.process_time() - start, record


@pytest.mark.benchmark(group="adaptive")
@pytest.mark.parametrize(("environment", "material"), [*SUN_LIT, *OTHERS])
def test_time_to_equal_rel_mse(benchmark, environment, material):
    """`extra_info.time_ratio`: seconds × relMSE of adaptive bakes over that of even ones. Below 1 is wanted."""
    light = load_environment(EnvironmentConfig(file=scenes() / "environments" / f"{environment}.exr"))
    bsdf = load_material(MaterialConfig(preset=material)).bsdf()
    integrator = SphereIntegrator(light.emitter(), bsdf, N, LobeSplit.of(bsdf))
    even, steered = [], []
    bake_all(integrator, False, 0)
    bake_all(integrator, True, 0)

    def both(seeds):
        seed = next(seeds)
        even.append(bake_all(integrator, False, seed))
        steered.append(bake_all(integrator, True, seed))

    benchmark.pedantic(partial(both, iter(range(1, ROUNDS + 1))), rounds=ROUNDS)
    (even_noise, even_seconds), (noise, seconds) = (
        (np.mean([run[0] for run in runs]), min(run[1] for run in runs)) for runs in (even, steered)
    )
    ratio = noise * seconds / (even_noise * even_seconds)
    gain = steered[-1][2].gain
    benchmark.extra_info.update(time_ratio=ratio, noise_ratio=noise / even_noise, predicted_gain=gain)
    allocated = "allocated" if steered[-1][2].scale is not None else "left even"
    print(  # noqa: T201
        f"\n{environment}, {material}: time to equal relMSE {ratio:.3f} of even samples' (noise at equal samples "
        f"{noise / even_noise:.3f}, predicted {1 / gain:.3f}, {allocated})"
    )
