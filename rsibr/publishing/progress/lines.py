"""Progress as lines, for a stderr that is no terminal: the log of a killed job says how far it was."""

from __future__ import annotations

import time
from collections.abc import Callable

from rsibr.validation.report.page import duration

LEAST_SECONDS, MOST_SECONDS = 2.0, 60.0
"""Bounds of the time between two lines [s]; between them it is a tenth of the time that has passed."""


class ProgressLines:
    """Prints a line when a job starts, and from then on ever more rarely.

    Parameters
    ----------
    name : str
        Name of the job, which begins each line.
    unit : str
        What is counted, such as "views"; empty for a share in percent.
    say : callable
        Prints a line.
    every : bool
        Print a line at every step, too.
    now : callable
        Clock [s].
    """

    def __init__(
        self,
        name: str,
        unit: str,
        say: Callable[[str], None],
        *,
        every: bool = False,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._name, self._unit, self._say, self._every, self._now = name, unit, say, every, now
        self._start = self._last = now()
        self._first: tuple[float, float] | None = None  # time of the first state, and the work that was done by then
        self._before: tuple[int, str] | None = None
        say(f"{name}: preparing")

    def show(self, done: float, total: float, step: str = "") -> None:
        """Print the state of the job, if enough time has passed since the last line.

        Parameters
        ----------
        done, total : float
            Work done, including that of earlier runs, and total work.
        step : str
            Current step, if it has a name.
        """
        now, at = self._now(), (int(done), step)
        passed = now - self._start
        stepped = self._every and at != self._before
        waited = now - self._last >= min(max(passed / 10, LEAST_SECONDS), MOST_SECONDS)
        if self._first is None or waited or stepped:
            self._say(self._line(done, total, step, passed))
            self._last = now
        self._first = self._first or (passed, done)
        self._before = at

    def _line(self, done: float, total: float, step: str, passed: float) -> str:
        share = f"{done / total:.0%}" if total else "100%"
        counted = f"{int(done)} of {int(total)} {self._unit} ({share})" if self._unit else share
        parts = [counted, *([step] if step else []), f"{duration(passed)} elapsed"]
        began, before = self._first or (passed, done)
        if before < done < total:
            parts.append(f"about {duration((passed - began) * (total - done) / (done - before))} left")
        return f"{self._name}: {', '.join(parts)}"
