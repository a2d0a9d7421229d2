"""How long the command line takes to begin: against Python itself, and against importing Mitsuba."""

import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rsibr.methods.registry import baseline_method, default_method
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


@pytest.mark.benchmark(group="command line")
def test_one_view_of_an_existing_bake(benchmark, tmp_path):
    """Processor seconds of `rsibr reconstruct` in all, kernels cached; at most 2 are wanted of `rsibr`."""
    bake, out = str(tmp_path / "paint.rsibr"), str(tmp_path / "view.exr")
    assert _ended([RSIBR, "bake", str(configs() / "demo.toml"), "--out", bake, "--set", "sampling.samples=16"]) == 0

    def processor_seconds(method):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert _ended([RSIBR, "reconstruct", bake, "--view", "1,2,3", "--method", method, "--out", out]) == 0
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    methods = (default_method(), baseline_method())
    taken = {method: [processor_seconds(method) for _ in range(4)][1:] for method in methods}
    benchmark.pedantic(lambda: processor_seconds(methods[0]), rounds=3)
    median = {method: float(np.median(seconds)) for method, seconds in taken.items()}
    benchmark.extra_info.update(processor_seconds=median)
    print("\nrsibr reconstruct: " + ", ".join(f"{name} {value:.2f} s of processor" for name, value in median.items()))  # noqa: T201


def _ended(words):
    return subprocess.run(words, capture_output=True, check=False).returncode
