"""What the page costs in a real Chromium on SwiftShader: first picture, processor time of a map, size of the bundle."""

import gc
import time

import psutil
import pytest

from rsibr.baking.baker import bake
from rsibr.geometry.frame import view_frame
from rsibr.publishing.bundle import bundle_of, engine_script
from rsibr.publishing.page import view
from rsibr.resources import configs, scenes
from rsibr.scene.config import parse_config
from tests.arrays import unit_vectors
from tests.browser import started
from tests.publishing.engine_page import columns, html

FRAMES = 12
METHODS = "cabral1999", "rsibr"

FIRST = """async () => {
  const begin = performance.now();
  const bundle = await rsibr.decodeBundle(document.getElementById("rsibr-bundle"));
  window.engine = new rsibr.Engine(document.createElement("canvas").getContext("webgl2"), bundle);
  const decoded = performance.now() - begin, frame = engine.frame([1, 2, 3]), times = {};
  for (const method of ["cabral1999", "rsibr"]) {
    engine.read(engine.map(method, frame, 256));
    times[method] = performance.now() - begin;
  }
  return { decoded, ...times };
}"""

TURN = """([method, frames, size]) => {
  const { gl } = engine;
  let map = null;
  for (const frame of frames) map = engine.map(method, frame, size);
  engine.read(engine.map(method, frames[0], 128, { mips: false }));  // waits for all of it
}"""

SHOWN = """(() => {
  const look = () => {
    if (document.getElementById("still")?.hidden) globalThis.shown = performance.now();
    else requestAnimationFrame(look);
  };
  look();
})()"""


def seconds_of_page(browser, file):
    """From navigation to the first picture of the whole page, and to that of its default method."""
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.add_init_script(SHOWN)
    page.goto(file.as_uri())
    page.evaluate("async () => { await rsibr.ready; await rsibr.viewer.settled(); }")
    first, whole = page.evaluate("() => [shown, performance.now()]")
    page.close()
    return first / 1e3, whole / 1e3


def processor_seconds():
    """Processor time that the browser and what it started have taken."""
    times = [one.cpu_times() for one in psutil.Process().children(recursive=True)]
    return sum(one.user + one.system for one in times)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """The demo's bake with few samples, which change no cost but the size by some per cent."""
    config = parse_config({**_demo(), "sampling": {"samples": 256}}, configs())
    return bake(config, out=tmp_path_factory.mktemp("bench") / "demo.rsibr")


def _demo():
    return {
        "environment": {"file": str(scenes() / "environments" / "city.exr")},
        "material": {"preset": "solid-red"},
        "map": {"resolution": 160},
    }


@pytest.mark.benchmark(group="the page")
def test_the_page(benchmark, demo, tmp_path, rng):
    """`extra_info`: sizes of engine, bundle and page, seconds to the first picture, processor milliseconds a map."""
    bundle = bundle_of(demo)
    file = tmp_path / "page.html"
    file.write_text(html(bundle), encoding="utf-8")
    whole = view(demo).write(tmp_path / "whole.html")
    frames = [columns(view_frame(v)) for v in unit_vectors(rng, FRAMES)]
    with started() as browser:
        of_page = seconds_of_page(browser, whole)
        page = browser.new_page()
        start = time.perf_counter()
        page.goto(file.as_uri())
        loaded = time.perf_counter() - start
        first = page.evaluate(FIRST)
        taken = {}
        for method in METHODS:
            for size in (256, 512):
                page.evaluate(TURN, [method, frames, size])
                gc.collect()
                before = processor_seconds()
                page.evaluate(TURN, [method, frames, size])
                taken[f"{method} {size}²"] = 1e3 * (processor_seconds() - before) / FRAMES
        benchmark.pedantic(page.evaluate, [TURN, ["rsibr", frames, 256]], rounds=3)
    sizes = {
        "page": whole.stat().st_size / 2**20,
        "bundle": bundle.size / 2**20,
        "engine": len(engine_script()) / 2**20,
    }
    benchmark.extra_info.update(
        first=first, processor_ms=taken, mebibytes=sizes, loaded_seconds=loaded, page_seconds=of_page
    )
    told = ", ".join(f"{name} {value:.0f} ms" for name, value in taken.items())
    told_sizes = ", ".join(f"{name} {value:.2f} MiB" for name, value in sizes.items())
    print(f"\nsize: {told_sizes}")  # noqa: T201
    print(f"the whole page: first picture after {of_page[0]:.2f} s, rsibr after {of_page[1]:.2f} s")  # noqa: T201
    seconds = ", ".join(f"{name} {1e-3 * value:.2f} s" for name, value in first.items())
    print(f"loaded in {loaded:.2f} s; then {seconds}")  # noqa: T201
    print(f"processor time a map with MIP levels: {told}")  # noqa: T201
