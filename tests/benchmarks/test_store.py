"""Opening a bake and loading its maps, against reading the same bytes from the same files."""

import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.methods.method_set import MethodSet
from rsibr.resources import configs
from rsibr.store.bake import open_bake
from tests.benchmarks.turns import in_turns, report

RESOLUTION = 256
OVERRIDES = (f"map.resolution={RESOLUTION}", "sampling.samples=8", "effects.resolution=on")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Directory of a bake of the demo's scene, twelve views."""
    path = tmp_path_factory.mktemp("store") / "demo.rsibr"
    bake(configs() / "demo.toml", out=path, overrides=OVERRIDES)
    return path


@pytest.mark.benchmark(group="store")
def test_opening_and_loading(benchmark, stored):
    """Opening hashes a bake of this size; loading reads its bytes again, checked again, and decodes the EXR files.

    `on the device`: the same, encoded and ready for `cabral1999` to look up.
    """
    files = [file for file in sorted(stored.rglob("*")) if file.is_file()]

    def load(_):
        opened = open_bake(stored)
        return [opened.map(index) for index in range(opened.view_count)]

    seconds = in_turns({
        "ours": lambda _: open_bake(stored),
        "opened, and all maps loaded": load,
        "opened, and on the device": lambda _: MethodSet(open_bake(stored))["cabral1999"],
        "the bytes read": lambda _: [file.read_bytes() for file in files],
    }, rounds=5)  # fmt: skip
    benchmark.pedantic(lambda: open_bake(stored), rounds=5)
    size = sum(file.stat().st_size for file in files)
    report(benchmark, f"a bake of {size / 2**20:.0f} MiB opened", seconds)
    assert all(np.isfinite(image.radiance).all() for image in load(0))


@pytest.mark.benchmark(group="store")
def test_opening_many_views_that_were_hashed(benchmark, tmp_path):
    """642 views, opened again: manifest, its consistency, and the state of every file; below 0.3 s is wanted."""
    sizes = ["map.resolution=16", "sampling.samples=8", "views.subdivision=3"]
    path = bake(configs() / "demo.toml", out=tmp_path / "many.rsibr", overrides=sizes).path
    assert open_bake(path).view_count == 642
    seconds = in_turns({
        "ours": lambda _: open_bake(path),
        "opened, and every byte hashed": lambda _: open_bake(path, rehash=True),
    })  # fmt: skip
    benchmark.pedantic(lambda: open_bake(path), rounds=5)
    report(benchmark, "a bake of 642 views opened again", seconds)
