"""The fuzzing that `make fuzz` runs, small in the fast tests and bigger in the slow ones."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.store import synthetic

SCRIPT = Path(__file__).parents[2] / "scripts" / "fuzz.py"


def fuzz(out: Path, inputs: int, seed: int) -> dict:
    command = [sys.executable, SCRIPT, "--inputs", inputs, "--seed", seed, "--out", out / "fuzz.json"]
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    report = json.loads((out / "fuzz.json").read_text())
    assert done.returncode == 0, done.stdout
    assert report["failures"] == []
    assert report["inputs"] >= inputs
    return report


@pytest.mark.parametrize(
    "target",
    ["config-bytes", "config-tables", "override", "views", "environment", "bake", "radiance", "exr", "mesh", "scene"],
)
def test_some_inputs_of_every_reader(tmp_path, monkeypatch, target):
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    from fuzz import ending
    from fuzz_inputs import Inputs

    synthetic.write(tmp_path / "small.rsibr")
    inputs = Inputs(tmp_path, tmp_path / "small.rsibr")
    endings = [ending(inputs.case(target, 7, number)) for number in range(60)]
    assert [detail for outcome, detail in endings if outcome not in ("accepted", "refused")] == []
    assert {outcome for outcome, _ in endings} == {"accepted", "refused"}


@pytest.mark.slow
@pytest.mark.parametrize(("inputs", "seed"), [(300, 1), (1500, 2)])
def test_no_input_leads_to_more_than_one_clear_error(tmp_path, inputs, seed):
    report = fuzz(tmp_path, inputs, seed)
    for target, counts in report["targets"].items():
        assert counts["refused"] > 0, target


def test_an_input_is_the_same_for_the_same_seed(tmp_path):
    code = (
        "import random, sys; from pathlib import Path; from fuzz_inputs import Inputs; place = Path(sys.argv[1])\n"
        "inputs = Inputs(place, place)\n"
        "for number in range(20): inputs.case('config-bytes', 3, number); "
        "sys.stdout.buffer.write((place / 'config.toml').read_bytes())"
    )
    runs = [
        subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=SCRIPT.parent, capture_output=True, check=True)
        for _ in range(2)
    ]
    assert runs[0].stdout == runs[1].stdout
    assert len(runs[0].stdout) > 2000
