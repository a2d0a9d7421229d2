"""What a dry run costs for 200 000 jobs, and how well its forecast of a small batch holds."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

from rsibr.resources import scenes
from tests.scene.maps import write_exr

MATERIALS, SKIES = 1000, 200
BATCH = """
base = {{environment = {{emitter = {{type = "constant"}}}}, material = {{preset = "matte-lambert"}}}}
name = "{{material}}/{{environment}}"
[matrix]
material = [{{file = "{materials}/*.xml"}}]
environment = ["{skies}/*.exr"]
"""
MATERIAL = '<bsdf version="3.0.0" type="diffuse"><rgb name="reflectance" value="{}, 0.5, 0.5"/></bsdf>'

DRY_RUN = """
import sys
from pathlib import Path
from rsibr.cli import app
def ended(code):
    print(1024 * int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]), file=sys.stderr)
    raise SystemExit(code)
app.end = ended
app.main()
"""


@pytest.mark.benchmark(group="batch")
def test_dry_run_of_two_hundred_thousand_jobs(benchmark, tmp_path):
    """Seconds and bytes of memory of `rsibr batch --dry-run --no-probe`; at most 10 s and 500 MB are wanted."""
    for name in ("materials", "skies"):
        (tmp_path / name).mkdir()
    for number in range(MATERIALS):
        (tmp_path / "materials" / f"m{number:04}.xml").write_text(MATERIAL.format(number / MATERIALS))
    write_exr(tmp_path / "sky.exr", np.full((4, 8, 3), 0.5))
    for number in range(SKIES):
        (tmp_path / "skies" / f"s{number:03}.exr").write_bytes((tmp_path / "sky.exr").read_bytes())
    file = tmp_path / "batch.toml"
    file.write_text(BATCH.format(materials=tmp_path / "materials", skies=tmp_path / "skies"))
    words = [sys.executable, "-c", DRY_RUN, "batch", str(file), "--dry-run", "--no-probe", "--json"]
    words += ["--out", str(tmp_path / "out")]
    taken, peaks = [], []

    def whole():
        start = perf_counter()
        ended = subprocess.run(words, capture_output=True, check=True, text=True)
        taken.append(perf_counter() - start)
        peaks.append(int(ended.stderr.split()[-1]))
        assert json.loads(ended.stdout)["jobs"] == MATERIALS * SKIES

    benchmark.pedantic(whole, rounds=3)
    benchmark.extra_info.update(seconds=min(taken), bytes=max(peaks))
    print(f"\ndry run of {MATERIALS * SKIES} jobs: {min(taken):.1f} s, {max(peaks) / 1e6:.0f} MB")  # noqa: T201


RSIBR = str(Path(sys.executable).with_name("rsibr"))
SMALL = """
base = {{material = {{preset = "solid-red"}}, environment = {{emitter = {{type = "constant"}}}}}}
[matrix]
material = ["solid-red", "metallic-blue"]
environment = ["{skies}/city.exr", "{skies}/studio.exr"]
"map.resolution" = [32]
"sampling.samples" = [16]
"""


@pytest.mark.benchmark(group="batch")
@pytest.mark.parametrize("executor", ["serial", "processes"])
def test_forecast_of_a_batch(benchmark, tmp_path, executor):
    """Processor time and bytes that a dry run foretells over those of a 2 × 2 batch, the whole command counted.

    `extra_info`: a ratio of processor times of 0.7 to 1.3 is wanted, and one of bytes of 0.9 to 1.1.
    """
    file = tmp_path / "batch.toml"
    file.write_text(SMALL.format(skies=scenes() / "environments"))
    seconds, sizes = [], []

    def both():
        out = tmp_path / f"out-{len(sizes)}"
        words = [RSIBR, "batch", str(file), "--executor", executor, "--json", "--out", str(out)]
        told = json.loads(subprocess.run([*words, "--dry-run"], capture_output=True, check=True).stdout)["forecast"]
        before = sum(os.times()[2:4])
        subprocess.run(words, capture_output=True, check=True)
        seconds.append(told["processor_seconds"] / (sum(os.times()[2:4]) - before))
        files = [path for path in out.rglob("*") if path.is_file() and path.parent != out]
        sizes.append(told["bytes"] / sum(path.stat().st_size for path in files))

    benchmark.pedantic(both, rounds=3)
    benchmark.extra_info.update(processor_ratios=seconds, bytes_ratios=sizes)
    found = f"processor time {np.median(seconds):.2f}, bytes {np.median(sizes):.3f}"
    print(f"\nforecast of a batch, {executor}, over what it took: {found}")  # noqa: T201
