"""Every command ends on one core, where Dr.Jit's pool has one thread and Mitsuba's OpenEXR files hang."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.cli.command import CONFIG
from tests.scene.maps import write_exr

ROOT = Path(__file__).parents[2]

COMMANDS = """
import os, sys
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import drjit as dr
from rsibr.cli.app import main

for line in sys.argv[1:]:
    sys.argv = ["rsibr", *line.split()]
    print(">", line, flush=True)
    try:
        main()
    except SystemExit as ended:
        assert not ended.code, (line, ended.code)
    assert dr.thread_count() == 1
"""

STUDY = """
base = "config.toml"
[scenes]
material = ["matte-lambert"]
environment = ["sky.exr"]
[[sweep]]
method = ["nearest"]
samples = [16, 36, 64]
resolution = [8]
[judge]
views = 2
samples = 64
repeats = 3
frames = 10
[path_tracing]
samples = [16, 36, 64]
"""

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity on this system")


@pytest.fixture
def one_core(tmp_path):
    """Return a function that runs commands one after another on one core, in a folder with an EXR environment."""
    write_exr(tmp_path / "sky.exr", np.full((4, 8, 3), 0.5))
    config = CONFIG.replace('emitter = {type = "constant", radiance = 0.5}', 'file = "sky.exr"')
    (tmp_path / "config.toml").write_text(config)
    emitter = config.replace('file = "sky.exr"', f'emitter = {{type = "envmap", filename = "{tmp_path}/sky.exr"}}')
    (tmp_path / "emitter.toml").write_text(emitter)

    def run(*lines: str) -> str:
        command = [sys.executable, "-c", COMMANDS, *lines]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=200, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr[-3000:]
        return done.stdout

    return run


@pytest.mark.slow
def test_commands_end_on_one_core(one_core):
    said = one_core(
        "bake config.toml --out x.rsibr",
        # A plugin of the user is tried in a child, which reads the file by itself
        "bake emitter.toml --out y.rsibr",
        "plan config.toml",
        "check x.rsibr",
        "reconstruct x.rsibr --view 1,2,3 --out x.exr",
        "validate x.rsibr --out report --views 1 --samples 16 --method nearest",
        "doctor",
    )
    assert "on 1 threads (1 of" in said


@pytest.mark.slow
def test_long_commands_end_on_one_core(one_core, tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    one_core("study study.toml --out study")
