"""The page of guarantees names tests that exist, all 33 hard cases among them, and commands and limits that are so."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from rsibr.store import health
from rsibr.validation.health import energy

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "guarantees.md").read_text(encoding="utf-8")


def defined(room: str = "") -> set[str]:
    """Names of all test functions, read and not imported."""
    names = set()
    for file in (ROOT / "tests" / room).rglob("test_*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        names |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    return names


def named() -> set[str]:
    return set(re.findall(r"`(test_\w+)`", PAGE))


def test_every_test_named_on_the_page_exists():
    assert len(named()) > 60
    assert named() - defined() == set()


def test_every_hard_case_has_a_row_with_its_tests():
    rows = re.findall(r"^\| (\d+) \|.*\| (.*) \|$", PAGE, re.MULTILINE)
    assert [int(number) for number, _ in rows] == list(range(1, 34))
    for number, tests in rows:
        assert re.findall(r"test_hc(\d\d)_", tests), number
        assert set(re.findall(r"test_hc(\d\d)_", tests)) == {f"{int(number):02d}"}


def test_no_test_of_a_hard_case_is_left_out():
    assert {name for name in defined("hard_cases") if name.startswith("test_hc")} - named() == set()


def test_the_goals_that_it_names_are_in_the_makefile():
    goals = set(re.findall(r"`make ([a-z-]+)`", PAGE))
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert goals >= {"test", "test-slow", "mutants", "fuzz"}
    assert all(re.search(rf"^{goal}:", makefile, re.MULTILINE) for goal in goals)


def test_the_limits_of_health_are_those_of_the_code():
    """As the page words them: a quarter, 16 samples, six times, eight standard errors, twelve, 15 %."""
    assert (health.FEW_SAMPLES, health.NOISIER, health.OUTLIER) == (1 / 4, 6, 8)
    assert 1 / health.FEW_SAMPLES**2 == 16
    assert ((2 * health.REACH + 1) ** 2 - 1) / 2 == 12
    assert health.LARGEST_HALF == 65504
    assert energy.LEAST_DRIFT == 0.15
