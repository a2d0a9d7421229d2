"""Rows, columns and groups of a matrix."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import pytest

from rsibr.batches.gallery.contact_sheet import contact_sheets, matrix_keys, shown


@dataclass
class Job:
    values: dict = field(default_factory=dict)


def test_the_first_key_makes_rows_the_second_columns_and_all_others_sheets():
    jobs = [
        Job({"material": m, "sky": s, "map.resolution": n})
        for m, s, n in product(("red", "blue"), ("noon", "night"), (32, 64))
    ]
    sheets = contact_sheets(jobs)
    assert [sheet.title for sheet in sheets] == ["map.resolution 32", "map.resolution 64"]
    assert all(sheet.columns == ["noon", "night"] for sheet in sheets)
    assert [list(sheet.rows) for sheet in sheets] == [["red", "blue"]] * 2
    assert sheets[1].rows["blue"]["noon"] == [jobs[5]]
    placed = [job for sheet in sheets for row in sheet.rows.values() for cell in row.values() for job in cell]
    assert sorted(map(id, placed)) == sorted(map(id, jobs))


def test_what_is_included_beside_the_matrix_has_a_sheet_of_its_own():
    jobs = [Job({"material": "red", "sky": "noon"}), Job({"material": "red", "sky": "noon", "sampling.samples": 4096})]
    assert matrix_keys(jobs) == ["material", "sky", "sampling.samples"]
    assert [sheet.title for sheet in contact_sheets(jobs)] == ["sampling.samples –", "sampling.samples 4096"]


@pytest.mark.parametrize("values", [{}, {"material": "red"}])
def test_one_key_or_none_is_one_sheet(values):
    (sheet,) = contact_sheets([Job(values), Job(values)])
    assert [len(cell) for row in sheet.rows.values() for cell in row.values()] == [2]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("solid-red", "solid-red"),
        (0.25, "0.25"),
        (256, "256"),
        (True, "on"),
        (None, "–"),
        ({"type": "sunsky", "turbidity": 3.0}, "type sunsky, turbidity 3"),
        ([1, [0.5, "x"]], "1, 0.5, x"),
    ],
)
def test_values_are_told_as_a_person_would(value, text):
    assert shown(value) == text
