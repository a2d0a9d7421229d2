"""Every input of `cases` has a test that names it."""

from pathlib import Path

import pytest

from tests.faults.cases import CASES

TESTS = "\n".join(path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_*.py"))


@pytest.mark.parametrize("name", sorted(path.name for path in CASES.iterdir()))
def test_a_case_is_named_by_a_test(name):
    assert f'"{name}"' in TESTS
