"""Processors of other kinds: their kernels round differently, so that no bake is continued on one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import rsibr
from rsibr import backend
from rsibr.baking.processor import processor
from tests.cli.command import write_config

SCRIPT = """
import ctypes, sys
import drjit as dr
from rsibr import backend
from rsibr.baking.processor import core_library, processor
from rsibr.baking import units
from rsibr.errors import BakeError

backend.use()
first = processor("llvm_ad_rgb")
units.prepare(sys.argv[1], sys.argv[2])
units._latest.clear()  # as in a process of its own
core_library()._Z19jit_llvm_set_targetPKcS0_j(b"x86-64-v3", b"+fma,+avx2,+f16c,+bmi2", ctypes.c_uint(8))
assert processor("llvm_ad_rgb") != first
try:
    units.bake_unit(sys.argv[2], [0])
except BakeError as error:
    print(error)
"""


def test_the_identity_names_processor_and_llvm(tmp_path):
    from rsibr.baking.units import prepare

    planned = prepare(write_config(tmp_path), tmp_path / "x.rsibr").manifest
    assert planned.identity["processor"] == processor(backend.use())


@pytest.mark.slow
@pytest.mark.skipif(backend.inspect().device != "llvm" or os.uname().machine != "x86_64", reason="a target of x86")
def test_a_unit_on_another_processor_is_refused_in_one_line(tmp_path):
    """Dr.Jit is told to compile for a processor with half as wide vectors: what its host would be there."""
    config, out = write_config(tmp_path), tmp_path / "x.rsibr"
    environment = os.environ | {"PYTHONPATH": str(Path(rsibr.__file__).parents[1])}
    command = [sys.executable, "-c", SCRIPT, str(config), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    assert "cannot be continued here, where maps would get other bits" in line
    assert "processor.target" in line
    assert not list((out / "maps").iterdir())
