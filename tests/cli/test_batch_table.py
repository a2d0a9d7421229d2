"""Table of a running batch: what it counts, what it shows, and its lines where there is no terminal."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from rsibr.batches.events import Finished, Note, Progressed, Started, Stopped, WorkerGone, WorkerUp
from rsibr.batches.job import Job
from rsibr.batches.result import JobResult
from rsibr.cli.batch_table import BatchTable


class Clock:
    def __init__(self):
        self.time = 1000.0

    def __call__(self):
        return self.time


def result(name, state="done", **fields):
    return JobResult.of(Job(name, {}, {}), state, **fields)


def played(console, clock):
    """Table after some events, at 90 s."""
    table = BatchTable(console, now=clock, jobs=10)
    for event in (WorkerUp("worker 1"), WorkerUp("worker 2"), Started("a", "worker 1"), Started("b", "worker 2")):
        table(event)
    clock.time += 10.0
    for event in (Stopped("a", "worker 1"), Finished(result("a", seconds=10.0, error=0.0012))):
        table(event)
    table(Started("c/city", "worker 1", "12 views"))
    clock.time += 50.0
    table(Progressed("b", "worker 2", 0.25))
    table(Note("something"))
    table(WorkerGone("worker 1", "SIGSEGV"))
    table(Finished(result("c/city", "failed", reason="ended its process\x1b[31m (SIGSEGV)")))
    return table


@pytest.fixture
def clock():
    return Clock()


def test_lines_where_there_is_no_terminal(clock):
    stream = io.StringIO()
    with played(Console(file=stream, width=80), clock):
        pass
    assert stream.getvalue().splitlines() == [
        "done: a (10 s, relMSE 0.0012; 1 of 10 done · 1 running · 0 failed · 6 a minute · 1.5 min left)",
        "note: c/city runs on worker 1 for 50 s; the longest so far took 10 s",
        "note: b runs on worker 2 for 1 min; the longest so far took 10 s",
        "note: something",
        "worker 1 is gone (SIGSEGV)",
        "failed: c/city: ended its process\\x1b[31m (SIGSEGV)",
    ]


def test_the_table_on_a_terminal(clock):
    stream = io.StringIO()
    with played(Console(file=stream, width=100, force_terminal=True, color_system=None), clock) as table:
        shown = Console(file=io.StringIO(), width=100, force_terminal=True, record=True)
        shown.print(table.render())
        told = shown.export_text()
    assert told.splitlines()[2].split() == ["worker", "job", "running", "for", "ended"]
    assert "1 of 10 done · 1 running · 1 failed · 2 a minute · 4 min left" in told
    assert "worker 1" not in told
    row = next(line for line in told.splitlines() if line.startswith("worker 2"))
    assert row.split() == ["worker", "2", "b", "25%", "1", "min", "slow", "0"]
    assert "note: something" in stream.getvalue()
    assert "done: a" not in stream.getvalue()  # the table counts it


def test_more_workers_than_fit_are_counted(clock):
    table = BatchTable(Console(file=io.StringIO()), now=clock)
    for number in range(40):
        table(WorkerUp(f"worker {number}"))
    shown = Console(file=io.StringIO(), width=80, record=True)
    shown.print(table.render())
    told = shown.export_text()
    assert "and 16 more workers" in told
    assert told.splitlines()[0] == "0 done · 0 running · 0 failed"
