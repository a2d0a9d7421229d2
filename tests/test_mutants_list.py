"""The list of guards: whole, and still of the sources as they are. `make mutants` runs it."""

import re
from pathlib import Path

import pytest

from scripts import mutants

ROOT = Path(__file__).resolve().parent.parent
LISTED = mutants.read_mutants()
SOURCES = {path: (ROOT / path).read_text(encoding="utf-8") for path in mutants.HARD_CASES.values()}


@pytest.mark.parametrize("case", [f"hc{number:02}" for number in range(1, 34)])
def test_every_hard_case_has_a_test_and_a_guard_to_take_out(case):
    listed = [mutant for mutant in LISTED if mutant.case == case]
    assert listed
    assert f"def test_{case}_" in SOURCES[listed[0].tests]


@pytest.mark.parametrize("mutant", LISTED, ids=lambda mutant: f"{mutant.case} {mutant.guard}")
def test_the_guard_stands_in_the_source_once(mutant):
    """Whoever rewrites a guard rewrites how it is taken out: `scripts/mutants.toml`."""
    assert mutant.applies
    assert mutant.new != mutant.old


@pytest.mark.parametrize("file", SOURCES)
def test_every_hard_case_says_when_it_fails_and_names_its_mutant(file):
    for case, body in re.findall(r"def test_(hc\d\d)_\w+\([^)]*\):\n((?: {4}.*\n|\n)+)", SOURCES[file]):
        assert "Fails when" in body, case
        assert f"mutant {case}" in body or f"mutants {case}" in body or "mutants\n" in body, case


def test_a_mutant_that_no_test_notices_is_reported():
    unchanged = LISTED[0]
    assert mutants._verdict(None, 0, "") == ("", "")
    assert mutants._verdict(unchanged, 0, "3 passed") == ("", "SURVIVED")
    assert mutants._verdict(unchanged, 1, "FAILED tests/a.py::test_b[1] - no") == ("test_b[1]", "")
    assert "BROKEN" in mutants._verdict(unchanged, 2, "ImportError")[1]
    assert "UNCHANGED" in mutants._verdict(None, 1, "FAILED tests/a.py::test_b")[1]
