"""What a batch costs beside its bakes: finding and forecasting 200 000 jobs."""

from __future__ import annotations

import json
import subprocess
import sys
from time import perf_counter

import numpy as np
import pytest

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
import resource, sys
from rsibr.cli.app import main
try:
    main()
finally:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, file=sys.stderr)
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
    print(f"\ndry run of {MATERIALS * SKIES} jobs: {min(taken):.1f} s, {max(peaks) / 1e6:.0f} MB")
