"""The list of alterations: whole, and still of the sources as they are. `make mutants` runs it."""

import re
from pathlib import Path

import pytest

from scripts import mutants

ROOT = Path(__file__).resolve().parent.parent
LISTED = mutants.read_mutants()
FORMULAS = [mutant for mutant in LISTED if not mutant.is_guard]
SOURCES = {path: (ROOT / path).read_text(encoding="utf-8") for path in mutants.HARD_CASES.values()}
ROOMS = {
    "reconstruction": ("rsibr/methods/", "rsibr/lobes/", "rsibr/light/"),
    "geometry": ("rsibr/geometry/",),
    "baking": ("rsibr/baking/",),
    "store": ("rsibr/store/",),
    "validation": ("rsibr/validation/",),
}


@pytest.mark.parametrize("case", [f"hc{number:02}" for number in range(1, 34)])
def test_every_hard_case_has_a_test_and_a_guard_to_take_out(case):
    listed = [mutant for mutant in LISTED if mutant.name == case]
    assert listed
    assert all(f"::test_{case}_" in test for test in listed[0].tests)
    assert listed[0].tests


@pytest.mark.parametrize("mutant", LISTED, ids=lambda mutant: f"{mutant.name} {mutant.what}")
def test_the_text_stands_in_the_source_once(mutant):
    """Whoever rewrites a guard or a formula rewrites how it is altered: `scripts/mutants.toml`."""
    assert mutant.applies
    assert mutant.new != mutant.old


def test_the_tests_that_should_notice_are_there():
    assert all(mutant.tests for mutant in LISTED)
    for test in {test for mutant in LISTED for test in mutant.tests}:
        path, *names = test.split("::")
        assert (ROOT / path).is_file(), test
        assert set(names) <= mutants.names_of_tests(path), test


def test_there_are_sixty_formulas_over_all_rooms_and_few_are_equivalent():
    assert len(FORMULAS) >= 60
    equivalent = [mutant for mutant in FORMULAS if mutant.equivalent]
    assert len(FORMULAS) - len(equivalent) >= 60
    assert len(equivalent) <= 5
    for room, folders in ROOMS.items():
        assert sum(mutant.file.startswith(folders) for mutant in FORMULAS) >= 8, room


def test_no_two_formulas_are_the_same():
    assert len({mutant.name for mutant in FORMULAS}) == len(FORMULAS)
    assert len({(mutant.file, mutant.old, mutant.new) for mutant in FORMULAS}) == len(FORMULAS)


@pytest.mark.parametrize("file", SOURCES)
def test_every_hard_case_says_when_it_fails_and_names_its_mutant(file):
    for case, body in re.findall(r"def test_(hc\d\d)_\w+\([^)]*\):\n((?: {4}.*\n|\n)+)", SOURCES[file]):
        assert "Fails when" in body, case
        assert f"mutant {case}" in body or f"mutants {case}" in body or "mutants\n" in body, case


CAUGHT = mutants.Mutant("a", "b", "c.py", "d", "e", ("tests/a.py",))
SAME = mutants.Mutant("f", "b", "c.py", "d", "d  ", ("tests/a.py",), equivalent="blanks")


def test_a_mutant_that_no_test_notices_is_reported():
    assert mutants._verdict(None, 0, "") == ("", "")
    assert mutants._verdict(CAUGHT, 0, "3 passed") == ("", "SURVIVED")
    assert mutants._verdict(CAUGHT, 1, "FAILED tests/a.py::test_b[1] - no") == ("test_b[1]", "")
    assert mutants._verdict(CAUGHT, 1, "ERROR tests/a.py::test_b - of its fixture") == ("test_b", "")
    assert "BROKEN" in mutants._verdict(CAUGHT, 2, "ImportError")[1]
    assert "UNCHANGED" in mutants._verdict(None, 1, "FAILED tests/a.py::test_b")[1]


def test_an_equivalent_mutant_must_survive():
    assert mutants._verdict(SAME, 0, "3 passed") == ("", "")
    assert "NOT EQUIVALENT" in mutants._verdict(SAME, 1, "FAILED tests/a.py::test_b")[1]


def test_the_summary_counts_each_once():
    outcomes = [
        mutants.Outcome(None),
        mutants.Outcome(CAUGHT, "test_b"),
        mutants.Outcome(CAUGHT, fault="SURVIVED"),
        mutants.Outcome(CAUGHT, fault="NOT FOUND: gone"),
        mutants.Outcome(SAME),
    ]
    said = list(mutants.summary(outcomes))
    assert said[0] == "guards taken out: tried 0, caught 0, equivalent 0, survived 0, not judged 0"
    assert said[1] == "formulas altered: tried 4, caught 1, equivalent 1, survived 1, not judged 1"
    assert said[2] == "  equivalent: f: blanks"
    assert len(said) == 5
