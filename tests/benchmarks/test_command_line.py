"""How long the command line takes to begin: against Python itself, and against importing Mitsuba."""

import subprocess
import sys
from pathlib import Path

import pytest

from rsibr.resources import configs
from tests.benchmarks.turns import in_turns, report

RSIBR = str(Path(sys.executable).with_name("rsibr"))


@pytest.mark.benchmark(group="command line")
def test_start_of_the_command_line(benchmark):
    """A help needs no renderer and does not wait for one; what needs it cannot start before it is there."""
    mistake = [RSIBR, "bake", str(configs() / "demo.toml"), "--out", "none.rsibr", "--set", "sampling.sample=4"]
    commands = {
        "ours": [RSIBR, "--help"],
        "rsibr --version": [RSIBR, "--version"],
        "a mistake in a config": mistake,
        "rsibr doctor": [RSIBR, "doctor"],
        "Python alone": [sys.executable, "-c", "pass"],
        "Mitsuba imported": [sys.executable, "-c", "import mitsuba; mitsuba.set_variant('llvm_ad_rgb'); mitsuba.Float"],
    }
    contenders = {name: (lambda _, words=words: _ended(words)) for name, words in commands.items()}
    seconds = in_turns(contenders, rounds=5)
    benchmark.pedantic(lambda: _ended(commands["ours"]), rounds=3)
    report(benchmark, "rsibr --help", seconds)
    assert _ended(mistake) == 2


def _ended(words):
    return subprocess.run(words, capture_output=True, check=False).returncode
