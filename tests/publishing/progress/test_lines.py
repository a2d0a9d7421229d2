"""Lines of progress: at once, then ever more rarely, with the time that is left."""

from __future__ import annotations

from rsibr.publishing.progress.lines import ProgressLines


class Clock:
    """A clock that stands still until it is set."""

    seconds = 0.0

    def __call__(self):
        return self.seconds


def said(steps, unit="views", total=100, **given):
    """Lines of a job that reports `(seconds, done, step)`."""
    clock, lines = Clock(), []
    progress = ProgressLines("bake", unit, lines.append, now=clock, **given)
    for seconds, done, step in steps:
        clock.seconds = seconds
        progress.show(done, total, step)
    return [line.replace("\u00a0", " ") for line in lines]


def test_a_job_says_at_once_that_it_began():
    assert said([]) == ["bake: preparing"]
    assert said([(0.5, 40, "view 41")])[1] == "bake: 40 of 100 views (40%), view 41, 500 ms elapsed"


def test_the_time_left_counts_the_work_of_this_run_alone():
    lines = said([(5, 40, ""), (15, 50, "")])
    assert lines[-1] == "bake: 50 of 100 views (50%), 15.0 s elapsed, about 50.0 s left"


def test_lines_become_rarer_and_a_minute_passes_at_most():
    seconds = [second / 2 for second in range(2 * 7200)]
    lines = said([(second, second, "") for second in seconds], total=7200)
    assert 7200 / 60 < len(lines) < 200
    assert len([line for line in lines if " min" not in line.split(" elapsed")[0]]) > 5  # of the first minute


def test_every_step_where_all_are_wanted():
    steps = [(0.01 * n, n // 2, f"view {n // 2}") for n in range(10)]
    assert len(said(steps, every=True)) == 1 + 5
    assert len(said(steps)) == 1 + 1


def test_work_that_is_time_has_a_share_only():
    assert said([(0, 0, "a"), (9, 45.5, "b")], unit="")[-1] == "bake: 46%, b, 9.00 s elapsed, about 10.8 s left"
    assert said([(0, 0, "")], unit="", total=0)[-1] == "bake: 100%, 0 ms elapsed"
