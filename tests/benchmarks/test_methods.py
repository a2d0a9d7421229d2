"""What a map costs by each method, of one bake, in turns: a car paint of three lobes, a new view each time."""

import time

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import normal_from_disk, texel_centres
from rsibr.methods.method_set import MethodSet
from rsibr.resources import scenes
from rsibr.scene.config import parse_config
from tests.arrays import unit_vectors
from tests.benchmarks.turns import in_turns

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


@pytest.mark.benchmark(group="a point by each method")
def test_a_point_by_each_method(benchmark, methods, rng):
    """`eval` at the points of a picture of 512² from one view, in turns; `extra_info`: nanoseconds of each."""
    resolution, made = methods
    frame = mi.Matrix3f(view_frame(unit_vectors(rng, 1)[0]).astype(np.float32))
    n = frame @ normal_from_disk(texel_centres(512))
    v = mi.Vector3f(frame[0, 2], frame[1, 2], frame[2, 2]) + dr.zeros(mi.Vector3f, dr.width(n))
    dr.eval(n, v)

    def evaluate(method):
        dr.eval(method.eval(n, v))
        dr.sync_thread()

    contenders = {name: (lambda _, method=method: evaluate(method)) for name, method in made.items()}
    seconds = in_turns(contenders, rounds=6)
    benchmark.pedantic(lambda: evaluate(made["rsibr"]), rounds=6)
    told = {name: 1e9 * float(np.median(taken)) / 512**2 for name, taken in seconds.items()}
    prepared = {name: method.cost.prepare_seconds for name, method in made.items()}
    benchmark.extra_info.update(resolution=resolution, nanoseconds=told, prepare_seconds=prepared)
    shown = ", ".join(f"{name} {told[name]:.0f} ns (prepared in {prepared[name]:.2f} s)" for name in made)
    print(f"\na point, maps of {resolution}²: {shown}")  # noqa: T201
