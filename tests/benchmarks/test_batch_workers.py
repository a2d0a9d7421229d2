"""Two workers of one thread against one worker of two threads: wall and processor time of the same batch."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rsibr.resources import configs, scenes

RSIBR = Path(sys.executable).with_name("rsibr")
BATCH = """
base = "{base}"
name = "{{material}}/{{environment}}"

[matrix]
material = ["solid-red", "metallic-silver"]
environment = ["{skies}/city.exr", "{skies}/courtyard.exr"]
"map.resolution" = [256]
"sampling.samples" = [64]

[run]
executor = "processes"
workers = {workers}
threads = {threads}
"""
ROUNDS = 3


@pytest.mark.benchmark(group="batch")
def test_workers_of_one_thread_against_one_of_two(benchmark, tmp_path):
    """`extra_info`: wall and processor time of 2 × 1 over those of 1 × 2, in pairs of whole commands.

    Four bakes of 256². At most 1.1 of the processor time is wanted.
    """
    files = {}
    for workers, threads in ((2, 1), (1, 2)):
        files[workers] = tmp_path / f"{workers}x{threads}.toml"
        text = BATCH.format(
            base=configs() / "demo.toml", skies=scenes() / "environments", workers=workers, threads=threads
        )
        files[workers].write_text(text)
    wall: dict[int, list[float]] = {1: [], 2: []}
    processor: dict[int, list[float]] = {1: [], 2: []}

    def pair():
        for workers, file in files.items():
            before, start = sum(os.times()[2:4]), time.perf_counter()
            out = tmp_path / f"out-{workers}-{len(wall[workers])}"
            subprocess.run([RSIBR, "batch", str(file), "--out", str(out)], capture_output=True, check=True)
            wall[workers].append(time.perf_counter() - start)
            processor[workers].append(sum(os.times()[2:4]) - before)

    benchmark.pedantic(pair, rounds=ROUNDS)
    ratios = {
        name: float(np.median(np.array(taken[2]) / np.array(taken[1])))
        for name, taken in (("wall", wall), ("processor", processor))
    }
    benchmark.extra_info.update(ratios=ratios, wall=wall, processor=processor)
    shown = {name: {workers: f"{np.median(taken[workers]):.1f} s" for workers in (2, 1)} for name, taken in (
        ("wall", wall), ("processor", processor)
    )}  # fmt: skip
    print(  # noqa: T201
        f"\nfour bakes of 256² by 2 workers × 1 thread: wall {shown['wall'][2]}, processor {shown['processor'][2]}; by "
        f"1 × 2: {shown['wall'][1]}, {shown['processor'][1]}; ratios {ratios['wall']:.2f} and {ratios['processor']:.2f}"
    )
