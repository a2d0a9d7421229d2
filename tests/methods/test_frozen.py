"""Whole maps replayed: the same as traced, traced once a size, and safe from the garbage collector."""

import subprocess
import sys
import weakref

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.registry import method_names
from tests.arrays import unit_vectors
from tests.methods.scene import method, mirror_sphere
from tests.methods.warp_blend.test_lobe_warp import coated, lobed, schlick
from tests.methods.warp_blend.test_method import METHODS

SIZES = (64, 48)
EVERY = [*METHODS, "rsibr"]


def make(name):
    if name == "rsibr":
        return lobed([(coated, 0.2, schlick), (mirror_sphere, 0.0, np.ones_like)])
    return method(**METHODS[name])


def traced(made, frame, resolution):
    """The map without a recording."""
    return made.image(mi.Float(frame.T.ravel().tolist()), resolution).numpy()


@pytest.mark.parametrize("name", EVERY)
def test_a_replay_equals_a_trace_at_two_sizes(name, rng):
    """To the last bit, sizes in turn, for views and stored views."""
    made = make(name)
    views = [*unit_vectors(rng, 4), made.viewpoints.directions[3], [0, 1, 0]]
    for frame in map(view_frame, views):
        for resolution in SIZES:
            replayed = made.map(frame, resolution).numpy().ravel()
            assert np.array_equal(replayed, traced(made, frame, resolution))
    assert made._frozen.recordings == len(SIZES)


@pytest.mark.parametrize("name", EVERY)
def test_from_the_second_view_on_nothing_is_traced_or_compiled(name, rng):
    made = make(name)
    frames = [view_frame(v) for v in unit_vectors(rng, 6)]
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.eval(made.map(frames[0], 64))
        dr.kernel_history_clear()
        for frame in frames[1:]:
            dr.eval(made.map(frame, 64))
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert made._frozen.recordings == 1
    assert len(launched) >= 2 * len(frames[1:])
    assert all(k["cache_hit"] and k["recording_mode"] == dr.KernelRecordingMode.Replayed for k in launched)


@pytest.mark.parametrize("name", method_names())
def test_sizes_in_turn_are_each_recorded_once(small_bakes, name, rng):
    """Of every method of a bake: a size that comes back is replayed, whatever other sizes came between."""
    made = MethodSet(small_bakes("clearcoat-red"))[name]
    sizes = (32, 48, 32, 64, 32, 48)
    for resolution, view in zip(sizes, unit_vectors(rng, len(sizes)), strict=True):
        frame = view_frame(view)
        replayed = made.map(frame, resolution).numpy().ravel()
        assert np.array_equal(replayed, traced(made, frame, resolution))
    assert made._frozen.recordings == len(set(sizes))


@pytest.mark.parametrize("name", ["cabral1999", "cabral1999-mesh", "rsibr"])
def test_eval_compiles_nothing_for_another_number_of_points(small_bakes, name, rng):
    made = MethodSet(small_bakes("clearcoat-red"))[name]

    def points(count):
        n, other = (dr.normalize(mi.Vector3f(np.array(unit_vectors(rng, count), np.float32).T)) for _ in range(2))
        v = dr.normalize(n + 0.5 * other)
        dr.eval(n, v)
        return n, v

    first, *others = [points(count) for count in (40, 90, 40, 160, 40, 90)]
    dr.eval(made.eval(*first))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for pair in others:
            dr.eval(made.eval(*pair))
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert launched
    assert all(kernel["cache_hit"] for kernel in launched)


def test_a_map_outlives_the_next_one(rng):
    """Each map has memory of its own: a replay may not write into what the last one handed out."""
    made = method()
    first, second = (view_frame(v) for v in unit_vectors(rng, 2))
    kept = made.map(first, 64)
    made.map(second, 64)
    assert np.array_equal(kept.numpy().ravel(), traced(made, first, 64))


def test_a_method_goes_with_its_last_user():
    """A recording must not hold the maps."""
    made = method()
    dr.eval(made.map(view_frame([1, 2, 3]), 64))
    gone = weakref.ref(made.sources)
    del made
    assert gone() is None


LITTERED = """
import gc
import numpy as np
import drjit as dr
import mitsuba as mi
from rsibr import backend
from rsibr.methods.frozen import Frozen
backend.use()

class Litter:
    def __init__(self):
        self.me, self.array = self, mi.Float(np.ones(1000, dtype=np.float32))

def doubled(x):
    y = dr.sin(x)
    dr.eval(y)
    [[i] for i in range(5000)]  # sets a collection off
    return 2 * y

x = dr.arange(mi.Float, 100) + 0
dr.eval(x)
replayed = Frozen(doubled)
for _ in range(50):
    Litter()
assert np.allclose(replayed(x).numpy(), 2 * np.sin(np.arange(100)), atol=1e-6)
assert gc.isenabled()
print("alive")
"""


def test_garbage_of_numpy_does_not_end_the_process_while_it_records():
    """Dr.Jit aborts where a NumPy-backed array is freed during a recording; in a process of its own for that reason."""
    done = subprocess.run([sys.executable, "-c", LITTERED], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "alive"


def test_a_recording_of_one_size_is_not_replayed_at_another(small_bakes):
    """Dr.Jit 1.5 took a map of 256² for one of 96² where the tables of both are alike in shape."""
    made = MethodSet(small_bakes("rough-aluminium"))["rsibr"]
    for resolution in (96, 256, 96):
        assert made.map(view_frame([1, 2, 3]), resolution).shape[:2] == (resolution, resolution)
    assert made._frozen.recordings == 2
