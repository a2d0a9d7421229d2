"""Public functions called by several threads at once: they end, and give the bits of serial calls.

Each case is a fresh process, in which the threads also import everything at once, and which a time limit ends.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from rsibr.baking.baker import bake

ROOT = Path(__file__).parents[1]

CONFIG = {
    "environment": {"emitter": {"type": "constant", "radiance": 0.5}},
    "material": {"bsdf": {"type": "roughplastic", "alpha": 0.2}},
    "map": {"resolution": 16},
    "sampling": {"samples": 16},
    "effects": {"view_dependence": "on", "resolution": "on"},
}

RECONSTRUCT = """
import sys, threading
import rsibr

views, made, errors = [(1, 0.1 * i, 0.5) for i in range(8)], {}, []
meeting = threading.Barrier(8)

def work(i):
    try:
        meeting.wait()
        made[i] = rsibr.reconstruct(sys.argv[1], views[i], method="rsibr", resolution=16).image.tobytes()
    except BaseException as error:
        errors.append(error)

threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert not errors, errors
serial = [rsibr.reconstruct(sys.argv[1], view, method="rsibr", resolution=16).image.tobytes() for view in views]
assert [made[i] for i in range(8)] == serial
assert len(set(serial)) == 8
"""

SHARED_METHODS = """
import asyncio, sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
import rsibr, mitsuba as mi
from rsibr.geometry.frame import view_frame

methods = rsibr.MethodSet(rsibr.open_bake(sys.argv[1]))
names = list(methods)
n = np.random.default_rng(0).normal(size=(3, 64))
n /= np.linalg.norm(n, axis=0)

def work(i):
    method, view = methods[names[i % len(names)]], np.eye(3)[i % 3]
    values = method.eval(mi.Vector3f(n.astype(np.float32)), mi.Vector3f(*view.tolist()))
    return method.map(view_frame(view), 16).numpy().tobytes() + np.array(values).tobytes()

with ThreadPoolExecutor(8) as pool:
    made = list(pool.map(work, range(24)))
assert made == [work(i) for i in range(24)]
assert len(set(made)) > 4  # neither one method nor one view for all

async def gathered():
    return await asyncio.gather(*(asyncio.to_thread(work, i) for i in range(24)))

assert asyncio.run(gathered()) == made
"""

BAKES = """
import sys, threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
import rsibr
sys.path.insert(0, sys.argv[2])
from tests.test_threads import CONFIG

others, folder, seen = ThreadPoolExecutor(1), Path(sys.argv[1]).parent, []

def on_progress(state):
    if not seen:  # a callback that waits for another thread, and one that calls rsibr itself
        seen.append(others.submit(rsibr.reconstruct, sys.argv[1], (1, 2, 3)).result().image.tobytes())
        seen.append(rsibr.reconstruct(sys.argv[1], (1, 2, 3)).image.tobytes())

def work(kind):
    match kind:
        case "bake":
            return rsibr.bake(CONFIG, out=folder / "again.rsibr", on_progress=on_progress)
        case "wrong":
            try:
                rsibr.bake(CONFIG, out=folder / "wrong.rsibr", overrides=["material.preset=none"])
            except rsibr.errors.InputError as error:
                return str(error)
        case "plan":
            return rsibr.plan(CONFIG)
        case "check":
            return rsibr.check(sys.argv[1])

import rsibr.errors
with ThreadPoolExecutor(4) as pool:
    again, wrong, plan, check = pool.map(work, ["bake", "wrong", "plan", "check"])
assert seen[0] == seen[1]
assert "preset" in wrong, wrong
first = rsibr.open_bake(sys.argv[1])
for index in range(first.view_count):
    name = f"maps/view_{index:04}.exr"
    assert (again.path / name).read_bytes() == (first.path / name).read_bytes(), name
"""


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    """Path of a bake of twelve maps with two lobes."""
    return bake(CONFIG, out=tmp_path_factory.mktemp("threads") / "first.rsibr").path


@pytest.mark.parametrize("code", [RECONSTRUCT, SHARED_METHODS, BAKES], ids=["reconstruct", "methods", "bakes"])
@pytest.mark.slow
def test_threads_end_with_the_bits_of_serial_calls(code, baked):
    command = [sys.executable, "-c", code, str(baked), str(ROOT)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
