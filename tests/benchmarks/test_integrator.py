"""The Mitsuba integrator against Mitsuba's `direct` on the same scene, 512², 16 samples; at most 0.3 is wanted."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.baking.baker import bake
from rsibr.baking.scene import Scene
from rsibr.resources import scenes
from rsibr.scene.config import parse_config
from rsibr.shading.integrator import register_plugins
from tests.benchmarks.turns import in_turns

SIZE, SAMPLES, ROUNDS = 512, 16, 6


@pytest.mark.benchmark(group="a picture by Mitsuba's integrators")
@pytest.mark.parametrize("material", ["metallic-blue", "glossy-plastic"])
def test_a_picture_by_each_integrator(benchmark, tmp_path, material):
    """A sphere that fills the picture, its material, and the sky that lights it; `extra_info`: seconds and ratios."""
    data = {
        "environment": {"file": str(scenes() / "environments" / "city.exr")},
        "material": {"preset": material},
        "map": {"resolution": 160},
        "sampling": {"samples": 4},
    }
    config = parse_config(data, scenes())
    path = str(bake(config, out=tmp_path / "paint.rsibr").path)
    prepared = Scene.prepare(config)
    register_plugins()
    ours = {"type": "rsibr", "bake": path, "method": "cabral1999", "occlusion": "off"}
    look = mi.ScalarTransform4f().look_at([2, 1, 3], [0, 0, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}}
    ball = backend.load({"type": "sphere"})
    ball.set_bsdf(prepared.material.bsdf())
    common = {"ball": ball, "light": prepared.environment.emitter()}
    common["sensor"] = {"type": "perspective", "fov": 28, "to_world": look, "film": film}

    def rendering(integrator):
        scene = backend.load({"type": "scene", "integrator": integrator, **common})

        def render(call):
            dr.eval(mi.render(scene, spp=SAMPLES, seed=call))
            dr.sync_thread()

        return render

    contenders = {"ours": rendering(ours), "direct": rendering({"type": "direct"}), "path": rendering({"type": "path"})}
    seconds = in_turns(contenders, rounds=ROUNDS)
    benchmark.pedantic(lambda: contenders["ours"](0), rounds=ROUNDS)
    median = {name: float(np.median(taken)) for name, taken in seconds.items()}
    over_direct = median["ours"] / median["direct"]
    benchmark.extra_info.update(seconds=median, over_direct=over_direct)
    shown = ", ".join(f"{name} {1e3 * value:.0f} ms" for name, value in median.items())
    print(f"\n{material}, {SIZE}², {SAMPLES} samples: {shown}; {over_direct:.2f} of direct")  # noqa: T201
