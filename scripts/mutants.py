"""Alter the sources in a copy, one formula or guard at a time, and see that a test notices.

    python scripts/mutants.py [--only hc07 bilinear-row-up …] [--jobs 2]

The list is `scripts/mutants.toml`: guards of the hard cases, taken out, and formulas, altered. One that no test notices
is not tested: the exit code is 1 where one survives, where its text is no longer found in the source, or where the
tests fail on the sources as they are. An alteration declared equivalent is run too, and must survive.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "scripts" / "mutants.toml"
COPIED = ("rsibr", "tests", "scenes", "configs", "pyproject.toml")
TIMEOUT_S = 300
UNCHANGED_TIMEOUT_S = 3600
"""For the tests of all mutants together, on the sources as they are."""

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
    """An alteration of the sources.

    Attributes
    ----------
    name : str
        The hard case of a guard, such as `hc07`, which may have several; a name of its own for a formula.
    what : str
        The guard that is taken out, or the formula and how it is altered, in words.
    file : str
        Source file, from the root of the repository.
    old, new : str
        The text that is replaced, exactly once in the file, and what stands in for it.
    tests : tuple of str
        The tests that should notice: files, or tests in files as pytest names them.
    equivalent : str
        Why the alteration changes nothing that a test could notice; empty for all others.
    """

    name: str
    what: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    equivalent: str = ""

    @property
    def is_guard(self) -> bool:
        """Whether it takes out the guard of a hard case."""
        return re.fullmatch(r"hc\d\d", self.name) is not None

    @property
    def applies(self) -> bool:
        """Whether the source still holds the text, once."""
        return (ROOT / self.file).read_text(encoding="utf-8").count(self.old) == 1


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant: the test that caught it, or why none did."""

    mutant: Mutant | None
    caught_by: str = ""
    fault: str = ""
    seconds: float = 0.0


def read_mutants(only: Sequence[str] = ()) -> list[Mutant]:
    """Read the list, or the part of it with some names."""
    listed = tomllib.loads(LIST.read_text(encoding="utf-8"))
    mutants = [*map(_guard, listed["mutant"]), *map(_formula, listed["formula"])]
    return [mutant for mutant in mutants if not only or mutant.name in only]


def _guard(entry: dict[str, Any]) -> Mutant:
    case, guard = entry.pop("case"), entry.pop("guard")
    return Mutant(name=case, what=guard, tests=_tests_of_case(case), **entry)


def _formula(entry: dict[str, Any]) -> Mutant:
    return Mutant(what=entry.pop("formula"), tests=tuple(entry.pop("tests")), **entry)


@cache
def _tests_of_case(case: str) -> tuple[str, ...]:
    path = next(path for cases, path in HARD_CASES.items() if int(case[2:]) in cases)
    return tuple(f"{path}::{name}" for name in names_of_tests(path) if name.startswith(f"test_{case}_"))


@cache
def names_of_tests(path: str) -> frozenset[str]:
    """Names of the test functions of a file."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    return frozenset(node.name for node in tree.body if isinstance(node, ast.FunctionDef) and "test" in node.name)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the mutants and print what became of each."""
    parser = argparse.ArgumentParser(description="Alter the sources in a copy and see that a test notices.")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="hard cases and names of formulas")
    parser.add_argument("--jobs", type=int, default=2, help="copies tested at a time")
    options = parser.parse_args(arguments)
    mutants = read_mutants(options.only)
    if unknown := set(options.only) - {mutant.name for mutant in mutants}:
        parser.error(f"no mutant for {' '.join(sorted(unknown))}")
    console, start = Console(width=None if sys.stdout.isatty() else 160), time.monotonic()
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(options.jobs) as pool:
        work = [None, *mutants]  # first the sources as they are: only then does a failing test mean anything
        futures = [pool.submit(_run, mutant, mutants, Path(scratch) / str(i)) for i, mutant in enumerate(work)]
        for future in as_completed(futures):
            console.print(_line(future.result()), markup=False, highlight=False)
        outcomes = [future.result() for future in futures]
    console.print(_table(outcomes))
    for line in summary(outcomes):
        console.print(line, markup=False, highlight=False)
    console.print(f"{time.monotonic() - start:.0f} s")
    return 1 if any(outcome.fault for outcome in outcomes) else 0


def summary(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield how many were tried and caught, the reasons of equivalent ones, and every fault."""
    tried = [(outcome, outcome.mutant) for outcome in outcomes if outcome.mutant is not None]
    for kind, is_guard in (("guards taken out", True), ("formulas altered", False)):
        of_kind = [(outcome, mutant) for outcome, mutant in tried if mutant.is_guard == is_guard]
        caught = sum(bool(outcome.caught_by and not outcome.fault) for outcome, _ in of_kind)
        equivalent = [mutant for outcome, mutant in of_kind if mutant.equivalent and not outcome.fault]
        survived = sum(outcome.fault == "SURVIVED" for outcome, _ in of_kind)
        yield (
            f"{kind}: tried {len(of_kind)}, caught {caught}, equivalent {len(equivalent)}, survived {survived}, "
            f"not judged {len(of_kind) - caught - len(equivalent) - survived}"
        )
        yield from (f"  equivalent: {mutant.name}: {mutant.equivalent}" for mutant in equivalent)
    yield from (f"  {_line(outcome)}" for outcome in outcomes if outcome.fault)


def _run(mutant: Mutant | None, mutants: Sequence[Mutant], folder: Path) -> Outcome:
    """Test one mutant; or, for None, the unchanged sources with all the tests."""
    start = time.monotonic()
    if mutant is not None and not mutant.applies:
        return Outcome(mutant, fault="NOT FOUND: the text is no longer there, once")
    _copy(folder)
    if mutant is not None:
        _alter(folder / mutant.file, mutant)
    chosen = _whole_files_first({test for m in ([mutant] if mutant is not None else mutants) for test in m.tests})
    returned, output = _pytest(folder, chosen, UNCHANGED_TIMEOUT_S if mutant is None else TIMEOUT_S)
    shutil.rmtree(folder)
    caught_by, fault = _verdict(mutant, returned, output)
    return Outcome(mutant, caught_by, fault, time.monotonic() - start)


def _copy(folder: Path) -> None:
    """Copy the sources with their bytecode, which stays valid as long as times and sizes are kept."""
    folder.mkdir(parents=True)
    for name in COPIED:
        source, target = ROOT / name, folder / name
        if name == "scenes":
            target.symlink_to(source)  # only read
        elif source.is_dir():
            shutil.copytree(source, target)
        elif source.exists():
            shutil.copy2(source, target)


def _alter(source: Path, mutant: Mutant) -> None:
    source.write_text(source.read_text(encoding="utf-8").replace(mutant.old, mutant.new), encoding="utf-8")
    for compiled in (source.parent / "__pycache__").glob(f"{source.stem}.*.pyc"):
        compiled.unlink()


def _whole_files_first(tests: set[str]) -> list[str]:
    """Sorted tests, without those of a file that is there as a whole."""
    return sorted(test for test in tests if "::" not in test or test.split("::")[0] not in tests)


def _pytest(folder: Path, tests: Sequence[str], timeout: int) -> tuple[int, str]:
    """Run the tests in the copy, until one fails."""
    options = ["-x", "-q", "-m", "", "-p", "no:cacheprovider", "--tb=line", "-rf"]
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-c", RUN, *options, *tests]
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=timeout, check=False
        )
    except subprocess.TimeoutExpired:
        return -1, f"no end after {timeout} s"
    return done.returncode, done.stdout + done.stderr


def _verdict(mutant: Mutant | None, returned: int, output: str) -> tuple[str, str]:
    """Name of the test that caught it, and what is wrong where none did."""
    last = next((line for line in reversed(output.splitlines()) if line.strip()), "")
    failed = re.search(r"^(?:FAILED|ERROR) \S+?::(\S+)", output, re.MULTILINE)
    if returned == 0:
        return "", "" if mutant is None or mutant.equivalent else "SURVIVED"
    if returned != 1 or not failed:
        return "", f"BROKEN: exit code {returned}: {last}"
    if mutant is None:
        return failed.group(1), f"FAILS UNCHANGED: {failed.group(1)}"
    return failed.group(1), f"NOT EQUIVALENT: {failed.group(1)} notices it" if mutant.equivalent else ""


def _line(outcome: Outcome) -> str:
    mutant = outcome.mutant
    name = f"{mutant.name}: {mutant.what}" if mutant else "the sources as they are"
    fine = "equivalent" if mutant and mutant.equivalent else "ok"
    return f"{name}: {outcome.fault or fine} ({outcome.seconds:.0f} s)"


def _table(outcomes: Sequence[Outcome]) -> Table:
    table = Table(title="Guards taken out and formulas altered")
    for heading in ("name", "what", "file", "caught by", "s"):
        table.add_column(heading, overflow="fold")
    for outcome in outcomes:
        if (mutant := outcome.mutant) is not None:
            file = mutant.file.removeprefix("rsibr/")
            ending = outcome.fault or outcome.caught_by or f"equivalent: {mutant.equivalent}"
            table.add_row(mutant.name, mutant.what, file, ending.replace("[", r"\["), f"{outcome.seconds:.0f}")
    return table


if __name__ == "__main__":
    sys.exit(main())
