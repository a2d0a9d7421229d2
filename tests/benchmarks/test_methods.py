"""What a map costs by each method, of one bake, in turns: a car paint of three lobes, a new view each time."""

import time

import drjit as dr
import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.resources import scenes
from rsibr.scene.config import parse_config
from tests.arrays import unit_vectors

METHODS = ("cabral1999", "rsibr", "rsibr-fine")
ROUNDS = 60


@pytest.fixture(scope="module", params=[160, 512])
def methods(request, tmp_path_factory):
    """The methods of a bake of so many texels a side; what they cost does not depend on its samples."""
    data = {
        "environment": {"file": str(scenes() / "environments" / "city.exr")},
        "material": {"preset": "metallic-blue"},
        "map": {"resolution": request.param},
        "sampling": {"samples": 4},
    }
    made = MethodSet(bake(parse_config(data, scenes()), out=tmp_path_factory.mktemp("bench") / "paint.rsibr"))
    return request.param, {name: made[name] for name in METHODS}


@pytest.mark.benchmark(group="a map by each method")
def test_a_map_by_each_method(benchmark, methods, rng):
    """`extra_info`: median seconds of each, and over that of `cabral1999`; at most 4 is wanted of `rsibr`."""
    resolution, made = methods
    frames = [view_frame(v) for v in unit_vectors(rng, ROUNDS)]

    def seconds(method, frame):
        start = time.perf_counter()
        dr.eval(method.map(frame, resolution))
        dr.sync_thread()
        return time.perf_counter() - start

    for method in made.values():
        seconds(method, frames[0])  # compiles and records
    taken = {name: [seconds(method, frame) for frame in frames] for name, method in made.items()}
    benchmark.pedantic(lambda frame: seconds(made["rsibr"], frame), [[frames[0]]][0], rounds=ROUNDS)
    median = {name: float(np.median(times)) for name, times in taken.items()}
    over = {name: value / median["cabral1999"] for name, value in median.items()}
    benchmark.extra_info.update(resolution=resolution, seconds=median, over_cabral1999=over)
    shown = ", ".join(f"{name} {1e3 * median[name]:.2f} ms ({over[name]:.1f}×)" for name in METHODS)
    print(f"\n{resolution}²: {shown}")  # noqa: T201
