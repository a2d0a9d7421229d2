"""The index is what the result files say, in every format, and damaged files cost nothing but themselves."""

from __future__ import annotations

import csv
import sqlite3
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from rsibr.batches.index import Index, rows_of, write_index
from rsibr.batches.job import Job, Then
from rsibr.batches.result import JobResult, read_result, read_results, write_result

JOBS = [
    Job("red/noon", {"material": "solid-red", "map.resolution": 256}, {"map": {"resolution": 256}}),
    Job("red/dawn", {"material": "solid-red", "map.resolution": "auto"}, {"map": {"resolution": "auto"}}),
    Job(
        "blue,\n'\"", {"material": "blue", "state": True}, {"map": {"resolution": 9}}, Then({"views": 4}, ("latlong",))
    ),
]
RESULTS = [
    JobResult.of(JOBS[0], "done", seconds=1.5, processor_seconds=2.5, bytes=2**33, views=12, error=1e-3, noise=2e-4),
    JobResult.of(JOBS[1], "failed", reason="Mitsuba crashed; 3 attempts", signal="SIGSEGV", attempts=3),
    JobResult.of(JOBS[2], "done", worker="node:17", then={"validate": {"report": "reports/x"}}),
]


def indexed(out: Path) -> Index:
    damaged: list[Path] = []
    return write_index(out, list(read_results(out, damaged.append)), damaged)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    for result in RESULTS:
        write_result(tmp_path, result)
    return tmp_path


def test_a_result_is_read_as_it_was_written(out):
    assert sorted(read_results(out), key=lambda one: one.name) == sorted(RESULTS, key=lambda one: one.name)
    assert read_result(out, "red/noon") == RESULTS[0]
    assert read_result(out, "red/dusk") is None


def test_a_result_answers_the_job_that_it_is_of():
    done, failed = RESULTS[0], RESULTS[1]
    assert done.answers(JOBS[0])
    assert not failed.answers(JOBS[1])
    assert not done.answers(Job("red/noon", JOBS[0].values, {"map": {"resolution": 512}}))
    assert not done.answers(Job("red/noon", JOBS[0].values, JOBS[0].settings, Then({"views": 8})))


def test_the_index_has_a_row_for_each_result(out):
    index = indexed(out)
    assert (index.done, index.failed, index.damaged) == (2, 1, ())
    rows = {row["name"]: row for row in rows_of(out / "index.sqlite")}
    assert (
        rows["red/noon"] | {"material": "solid-red", "bytes": 2**33, "error": 1e-3, "state": "done"} == rows["red/noon"]
    )
    assert rows["red/dawn"]["signal"] == "SIGSEGV"
    assert rows["blue,\n'\""]["value_state"] == "true"
    with sqlite3.connect(out / "index.sqlite") as connection:
        found = connection.execute('SELECT name FROM jobs WHERE "map.resolution" = 256 AND state = ?', ["done"])
        assert found.fetchall() == [("red/noon",)]


def test_csv_and_parquet_hold_the_same(out):
    import pandas as pd

    indexed(out)
    rows = list(rows_of(out / "index.sqlite"))
    with (out / "index.csv").open(newline="") as file:
        table = sorted(csv.DictReader(file), key=lambda row: row["name"])
    assert table == [{key: "" if value is None else str(value) for key, value in row.items()} for row in rows]
    frame = pd.read_parquet(out / "index.parquet").set_index("name")
    assert list(frame.loc["red/noon", ["bytes", "views", "error"]]) == [2**33, 12, 1e-3]
    assert list(frame["map.resolution"].dropna()) == ["auto", "256"]
    assert frame.loc["red/dawn"].isna()["exit_code"]


def test_the_index_is_made_anew_without_the_damaged(out):
    indexed(out)
    (out / "index.sqlite").write_bytes(b"rubbish")
    (out / "results" / "red" / "noon.json").write_text('{"name": "red/noon", "state"')
    (out / "results" / "red" / "dawn.json").rename(out / "results" / "dawn.json")  # of another job
    (out / "results" / "list.json").write_text("[1, 2]")
    index = indexed(out)
    assert (index.done, index.failed, len(index.damaged)) == (1, 0, 3)
    assert [row["name"] for row in rows_of(out / "index.sqlite")] == ["blue,\n'\""]


def test_a_result_that_is_no_number_is_damaged(out):
    path = out / "results" / "red" / "noon.json"
    text = path.read_text()
    for spoilt in (text.replace('"views": 12', '"views": "many"'), text.replace('"done"', '"well"')):
        assert spoilt != text
        path.write_text(spoilt)
        assert read_result(out, "red/noon") is None


def test_an_empty_batch_has_an_empty_index(tmp_path):
    index = indexed(tmp_path)
    assert (index.done, index.failed) == (0, 0)
    assert list(rows_of(tmp_path / "index.sqlite")) == []


def test_without_pandas_there_is_no_parquet(out, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert [path.name for path in indexed(out).files] == ["index.sqlite", "index.csv"]


def test_not_finite_numbers_are_never_written(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_result(tmp_path, replace(RESULTS[0], error=float("nan")))
    assert list(read_results(tmp_path)) == []
