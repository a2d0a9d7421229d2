"""What follows each end of a task, for all executors alike."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest

from rsibr import machine
from rsibr.batches.events import Finished, Note
from rsibr.batches.job import Job
from rsibr.batches.ledger import CHUNK, MOST_LOST, Death, Ledger
from rsibr.batches.result import JobResult, read_result
from rsibr.batches.tasks import Outcome, Task
from rsibr.errors import MachineError

SEGFAULT = Death("SIGSEGV", None, "in fatal.py")


def jobs(count, views=12):
    level = {12: 0, 42: 1, 162: 2}[views]
    return [Job(f"job-{number}", {}, {"views": {"subdivision": level}}) for number in range(count)]


class Run:
    """A ledger, what it told, and shorthands for ends of tasks."""

    def __init__(self, out, found, workers=2, **options):
        self.events, self.out = [], out
        self.ledger = Ledger(found, out, self.events.append, workers=workers, **options)
        for number in range(workers):
            self.ledger.worker_up(f"w{number}")

    def take(self, worker="w0"):
        task = self.ledger.next(worker)
        if task is not None:
            self.ledger.started(task, worker)
        return task

    def done(self, task, **fields):
        self.ledger.ended(task, Outcome(JobResult.of(task.job, "done", attempts=task.attempt, **fields)))

    def fails(self, task, exit_code=2):
        result = JobResult.of(task.job, "failed", reason="why", exit_code=exit_code, attempts=task.attempt)
        self.ledger.ended(task, Outcome(result, seconds=1.0))

    def results(self):
        return {event.result.name: event.result for event in self.events if isinstance(event, Finished)}

    def notes(self):
        return [event.text for event in self.events if isinstance(event, Note)]


def test_each_job_is_taken_once_and_jobs_are_read_as_they_are_needed(tmp_path):
    read = []
    run = Run(tmp_path, (read.append(one.name) or one for one in jobs(20)))
    task = run.take()
    assert len(read) <= 3
    taken = [task.job.name]
    while not run.ledger.is_over:
        run.done(task)
        task = run.take()
        taken += [task.job.name] if task else []
    assert taken == [one.name for one in jobs(20)]
    assert (run.ledger.done, run.ledger.failed) == (20, 0)


def test_a_job_that_ends_its_process_runs_once_more_alone_after_the_others(tmp_path):
    run = Run(tmp_path, jobs(3))
    fatal, other = run.take("w0"), run.take("w1")
    run.ledger.died(fatal, SEGFAULT)
    last = run.take("w0")
    assert last.job.name == "job-2"
    assert run.take("w0") is None
    run.done(other)
    assert run.take("w1") is None  # the machine is not its own yet
    run.done(last)
    again = run.take("w1")
    assert (again.job, again.attempt, again.alone) == (fatal.job, 2, True)
    run.ledger.died(again, SEGFAULT)
    assert run.ledger.is_over
    found = run.results()["job-0"]
    assert (found.state, found.signal, found.attempts) == ("failed", "SIGSEGV", 2)
    assert found.reason == "ended its process (SIGSEGV), and again in a fresh one that ran nothing else: in fatal.py"
    assert read_result(tmp_path, "job-0") == found


def test_an_innocent_job_on_a_worker_that_died_is_done_alone(tmp_path):
    run = Run(tmp_path, jobs(1))
    run.ledger.died(run.take(), Death("SIGKILL"))
    run.done(run.take())
    assert (run.ledger.done, run.ledger.failed, run.results()["job-0"].attempts) == (1, 0, 2)


def test_a_worker_that_is_lost_without_a_word_costs_a_job_nothing_three_times(tmp_path):
    run = Run(tmp_path, jobs(1), crowded=False)
    for _ in range(MOST_LOST):
        assert not run.ledger.is_over
        run.ledger.died(run.take(), Death(lost=True))
    assert run.results()["job-0"].reason.startswith("ended its process (its worker was lost)")


def test_a_fault_of_the_job_is_not_repeated(tmp_path):
    run = Run(tmp_path, jobs(1))
    run.fails(run.take())
    assert run.ledger.is_over
    assert (run.results()["job-0"].reason, run.ledger.failed) == ("why", 1)


def test_a_fault_of_the_machine_is_tried_on_another_worker_and_that_worker_is_set_aside(tmp_path):
    run = Run(tmp_path, jobs(4))
    for number in range(2):
        run.fails(run.take("w0"), exit_code=3)
        again = run.take("w1")
        assert (again.job.name, again.attempt, again.seconds) == (f"job-{number}", 2, 1.0)
        run.done(again)
    assert run.ledger.is_set_aside("w0")
    assert run.take("w0") is None
    for _ in range(2):
        run.done(run.take("w1"))
    assert (run.ledger.is_over, run.ledger.done) == (True, 4)
    assert any("w0 gets no more jobs" in note for note in run.notes())


def test_a_fault_of_the_only_machine_is_tried_there_again_and_then_believed(tmp_path):
    run = Run(tmp_path, jobs(1), workers=1)
    run.fails(run.take(), exit_code=3)
    run.fails(run.take(), exit_code=3)
    assert (run.ledger.is_over, run.ledger.failed) == (True, 1)


def test_a_full_disk_of_the_batch_ends_it_before_every_job_has_failed(tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "free_disk", lambda _: 1000)
    run = Run(tmp_path, jobs(1000))
    with pytest.raises(MachineError, match=r"the disk is full: why\. Free some space"):
        run.fails(run.take(), exit_code=3)


def test_large_bakes_are_split_only_where_workers_would_be_idle(tmp_path):
    steps = Counter()
    run = Run(tmp_path, jobs(6, views=42), workers=3)
    while (task := run.take(f"w{len(steps) % 3}")) is not None:
        steps[task.step] += 1
        if task.step == "prepare":
            break
        run.done(task)
    assert steps == {"whole": 4, "prepare": 1}  # with two more jobs every worker has one
    assert Run(tmp_path, jobs(1, views=12)).take().step == "whole"
    assert Run(tmp_path, jobs(1, views=42), workers=1).take().step == "whole"
    budget = Job("job", {}, {"views": {"subdivision": 2}, "budget": {"error": 0.1}})
    assert Run(tmp_path, [budget]).take().step == "whole"


def test_a_split_bake_has_each_view_once_and_ends_with_its_times(tmp_path):
    run = Run(tmp_path, jobs(1, views=162))
    prepare = run.take("w0")
    assert run.take("w1") is None
    run.ledger.ended(prepare, Outcome(pending=tuple(range(162)), seconds=1.0, processor_seconds=2.0))
    seen, workers = [], itertools.cycle(["w0", "w1"])
    while (task := run.take(next(workers))).step == "views":
        assert len(task.views) <= CHUNK
        seen += task.views
        run.ledger.ended(task, Outcome(seconds=0.5, processor_seconds=0.25))
    assert sorted(seen) == list(range(162))
    assert (task.step, task.seconds, task.processor_seconds) == ("finish", 1 + 14 * 0.5, 2 + 14 * 0.25)
    run.done(task)
    assert run.ledger.is_over


def test_a_worker_goes_on_with_the_bake_that_it_has_prepared(tmp_path):
    run = Run(tmp_path, jobs(2, views=42), workers=3)
    first, second = run.take("w0"), run.take("w1")
    for task in (first, second):
        run.ledger.ended(task, Outcome(pending=tuple(range(42))))
    for worker, name in (("w1", "job-1"), ("w0", "job-0"), ("w1", "job-1")):
        task = run.take(worker)
        assert task.job.name == name
        run.ledger.ended(task, Outcome())


def test_a_split_bake_of_which_a_part_fails_is_over(tmp_path):
    run = Run(tmp_path, jobs(1, views=42))
    run.ledger.ended(run.take("w0"), Outcome(pending=tuple(range(42))))
    one, two = run.take("w0"), run.take("w1")
    run.fails(one)
    assert run.take("w0") is None
    run.fails(two)
    assert run.ledger.is_over
    assert (run.ledger.failed, len(run.results())) == (1, 1)


def test_a_split_bake_whose_worker_dies_goes_on_with_the_views_that_are_left(tmp_path):
    run = Run(tmp_path, jobs(1, views=42))
    run.ledger.ended(run.take("w0"), Outcome(pending=tuple(range(24))))
    one, two = run.take("w0"), run.take("w1")
    run.ledger.died(one, Death("SIGKILL"))
    run.ledger.ended(two, Outcome())
    again = run.take("w0")
    assert (again.views, again.alone) == (one.views, True)
    run.ledger.ended(again, Outcome())
    end = run.take("w0")
    assert (end.step, end.attempt) == ("finish", 2)


def test_tasks_and_outcomes_come_back_from_their_records(tmp_path):
    one = Task(jobs(1)[0], "views", (3, 4), attempt=2, alone=True, avoid="w", seconds=1.5)
    assert Task.from_record(one.to_record()) == one
    found = Outcome(JobResult.of(one.job, "done", error=0.5), (1, 2), 3.0, 4.0)
    assert Outcome.from_record(found.to_record()) == found
