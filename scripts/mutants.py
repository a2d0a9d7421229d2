"""Take each guard of the hard cases out of a copy of the sources, and see that a test notices.

    python scripts/mutants.py [--only hc07 …] [--jobs 2]

A guard that no test misses is not guarded: the exit code is 1 where one survives, where its text is no longer found in
the source, or where the tests fail on the sources as they are. The list is `scripts/mutants.toml`.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "scripts" / "mutants.toml"
COPIED = ("rsibr", "tests", "scenes", "configs", "pyproject.toml")
TIMEOUT_S = 300

RUN = """
import sys
from pathlib import Path
import pytest, rsibr
if not Path(rsibr.__file__).is_relative_to(Path.cwd()):
    raise SystemExit(f"{rsibr.__file__} is not the copy")
sys.exit(pytest.main(sys.argv[1:]))
"""
"""Run in the copy: an editable install must not stand in for it."""

HARD_CASES = {
    range(1, 9): "tests/hard_cases/test_weights.py",
    range(9, 16): "tests/hard_cases/test_frames_and_rim.py",
    range(16, 24): "tests/hard_cases/test_radiometry.py",
    range(24, 30): "tests/hard_cases/test_dynamic_range.py",
    range(30, 34): "tests/hard_cases/test_metrics.py",
}
"""Where the tests of a hard case stand; those named after its number are run."""


@dataclass(frozen=True)
class Mutant:
    """A guard, and how it is removed.

    Attributes
    ----------
    case : str
        The hard case, `hc07`.
    guard : str
        What is taken out, in words.
    file : str
        Source file, from the root of the repository.
    old, new : str
        The text that guards, exactly once in the file, and what stands in for it.
    """

    case: str
    guard: str
    file: str
    old: str
    new: str

    @property
    def tests(self) -> str:
        """The file with the tests that should notice."""
        return next(path for cases, path in HARD_CASES.items() if int(self.case[2:]) in cases)

    @property
    def applies(self) -> bool:
        """Whether the source still holds the guard, once."""
        return (ROOT / self.file).read_text(encoding="utf-8").count(self.old) == 1


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant: the test that caught it, or why none did."""

    mutant: Mutant | None
    caught_by: str = ""
    fault: str = ""
    seconds: float = 0.0


def read_mutants(only: Sequence[str] = ()) -> list[Mutant]:
    """Read the list, or the part of it for some hard cases."""
    listed = [Mutant(**entry) for entry in tomllib.loads(LIST.read_text(encoding="utf-8"))["mutant"]]
    return [mutant for mutant in listed if not only or mutant.case in only]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the mutants and print what became of each."""
    parser = argparse.ArgumentParser(description="Remove each guard in a copy and see that a test notices.")
    parser.add_argument("--only", nargs="+", default=[], metavar="hcNN", help="hard cases to take")
    parser.add_argument("--jobs", type=int, default=2, help="copies tested at a time")
    options = parser.parse_args(arguments)
    mutants = read_mutants(options.only)
    if not mutants:
        parser.error(f"no mutant for {' '.join(options.only)}")
    console = Console(width=None if sys.stdout.isatty() else 160)
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(options.jobs) as pool:
        work = [None, *mutants]  # first the sources as they are: only then does a failing test mean anything
        futures = [pool.submit(_run, mutant, mutants, Path(scratch) / str(i)) for i, mutant in enumerate(work)]
        outcomes = []
        for future in futures:
            outcomes.append(future.result())
            console.print(_line(outcomes[-1]))
    failed = [outcome for outcome in outcomes if outcome.fault]
    console.print(_table(outcomes))
    console.print(f"{len(mutants)} guards removed, {len(outcomes) - 1 - len([f for f in failed if f.mutant])} caught")
    return 1 if failed else 0


def _run(mutant: Mutant | None, mutants: Sequence[Mutant], folder: Path) -> Outcome:
    """Test one mutant; or, for None, the unchanged sources with all the tests."""
    start = time.monotonic()
    if mutant is not None and not mutant.applies:
        return Outcome(mutant, fault="NOT FOUND: the guard's text is no longer there, once")
    _copy(folder)
    if mutant is not None:
        source = folder / mutant.file
        source.write_text(source.read_text(encoding="utf-8").replace(mutant.old, mutant.new), encoding="utf-8")
    chosen = [mutant] if mutant is not None else mutants
    returned, output = _pytest(folder, sorted({m.tests for m in chosen}), sorted({m.case for m in chosen}))
    shutil.rmtree(folder)
    caught_by, fault = _verdict(mutant, returned, output)
    return Outcome(mutant, caught_by, fault, time.monotonic() - start)


def _copy(folder: Path) -> None:
    folder.mkdir(parents=True)
    for name in COPIED:
        source, target = ROOT / name, folder / name
        if name == "scenes":
            target.symlink_to(source)  # only read
        elif source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        elif source.exists():
            shutil.copy2(source, target)


def _pytest(folder: Path, files: Sequence[str], cases: Sequence[str]) -> tuple[int, str]:
    """Run the tests of the cases in the copy, until one fails."""
    names = " or ".join(f"test_{case}_" for case in cases)
    options = ["-x", "-q", "-m", "", "-p", "no:cacheprovider", "--tb=line", "-rf", "-k", names]
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", RUN, *options, *files]
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return -1, f"no end after {TIMEOUT_S} s"
    return done.returncode, done.stdout + done.stderr


def _verdict(mutant: Mutant | None, returned: int, output: str) -> tuple[str, str]:
    """Name of the test that caught it, and what is wrong where none did."""
    last = next((line for line in reversed(output.splitlines()) if line.strip()), "")
    failed = re.search(r"^FAILED \S+::(\S+)", output, re.MULTILINE)
    if returned == 0:
        return "", "" if mutant is None else "SURVIVED"
    if returned == 1 and failed:
        return failed.group(1), "" if mutant is not None else f"FAILS UNCHANGED: {failed.group(1)}"
    return "", f"BROKEN: exit code {returned}: {last}"


def _line(outcome: Outcome) -> str:
    name = f"{outcome.mutant.case} {outcome.mutant.guard}" if outcome.mutant else "the sources as they are"
    return f"{name}: {outcome.fault or 'ok'} ({outcome.seconds:.0f} s)"


def _table(outcomes: Sequence[Outcome]) -> Table:
    table = Table(title="Guards of the hard cases")
    for heading in ("case", "guard taken out", "file", "caught by"):
        table.add_column(heading, overflow="fold")
    for case, guard, file, caught in _rows(outcomes):
        table.add_row(case, guard, file, caught)
    return table


def _rows(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, str, str, str]]:
    for outcome in outcomes:
        if outcome.mutant is not None:
            mutant = outcome.mutant
            yield mutant.case, mutant.guard, mutant.file.removeprefix("rsibr/"), outcome.fault or outcome.caught_by


if __name__ == "__main__":
    sys.exit(main())
