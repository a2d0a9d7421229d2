"""Table of a running batch on a terminal, and lines where there is none; both on stderr."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from threading import RLock
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from rsibr.errors import printable

if TYPE_CHECKING:
    from rsibr.batches.events import Event

MOST_ROWS = 24
"""Workers that the table lists."""

SLOW = 3.0
"""Times the longest job so far from which a job is called slow. It goes on: nothing is ended for being slow."""

LEAST_SLOW = 30.0
"""Time under which no job is called slow [s]."""


@dataclass
class _Worker:
    """Row of a worker."""

    job: str = ""
    part: str = ""
    share: float = 0.0
    since: float = 0.0
    ended: int = 0
    told_slow: bool = False


@dataclass
class BatchTable:
    """Shows the events of a batch: `with BatchTable(console) as table: …, on_event=table`.

    Parameters
    ----------
    console : Console
        Where it is shown.
    now : callable
        Clock [s].

    Attributes
    ----------
    jobs : int
        Number of jobs that are to run; 0 until it is known.
    """

    console: Console
    now: Callable[[], float] = time.monotonic
    jobs: int = 0
    _workers: dict[str, _Worker] = field(default_factory=dict)
    _states: Counter[str] = field(default_factory=Counter)
    _longest: float = 0.0
    _begun: float | None = None
    _lock: RLock = field(default_factory=RLock)
    _stack: ExitStack = field(default_factory=ExitStack)

    def __enter__(self) -> Self:
        """Return the table itself; shown from the first event on."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Take the table away; lines stay."""
        self._stack.close()

    def __call__(self, event: Event) -> None:
        """Take an event."""
        with self._lock:
            if self._begun is None:
                self._begun = self.now()
                if self.console.is_terminal:
                    live = Live(get_renderable=self.render, console=self.console, transient=True, refresh_per_second=4)
                    self._stack.enter_context(live)
            getattr(self, f"_{type(event).__name__}")(event)
            self._tell_slow()

    # ── events ───────────────────────────────────────────────────────────────────────────────────────────────────────

    def _WorkerUp(self, event: Event) -> None:  # noqa: N802  # name of the event
        self._workers.setdefault(event.worker, _Worker())  # type: ignore[union-attr]

    def _WorkerGone(self, event: Event) -> None:  # noqa: N802
        gone = self._workers.pop(event.worker, None)  # type: ignore[union-attr]
        if gone is not None and event.reason:  # type: ignore[union-attr]
            self._line(f"{event.worker} is gone ({event.reason})", "yellow")  # type: ignore[union-attr]

    def _Started(self, event: Event) -> None:  # noqa: N802
        row = self._workers.setdefault(event.worker, _Worker())  # type: ignore[union-attr]
        row.job, row.part, row.share = event.job, event.part, 0.0  # type: ignore[union-attr]
        row.since, row.told_slow = self.now(), False

    def _Progressed(self, event: Event) -> None:  # noqa: N802
        row = self._workers.get(event.worker)  # type: ignore[union-attr]
        if row is not None and row.job == event.job:  # type: ignore[union-attr]
            row.share = event.share  # type: ignore[union-attr]

    def _Stopped(self, event: Event) -> None:  # noqa: N802
        row = self._workers.get(event.worker)  # type: ignore[union-attr]
        if row is not None and row.job == event.job:  # type: ignore[union-attr]
            self._longest = max(self._longest, self.now() - row.since)
            row.job, row.part, row.ended = "", "", row.ended + 1

    def _Finished(self, event: Event) -> None:  # noqa: N802
        result = event.result  # type: ignore[union-attr]
        self._states[result.state] += 1
        if result.state == "failed":
            self._line(f"failed: {result.name}: {result.reason}", "red")
        elif not self.console.is_terminal:
            error = "" if result.error is None else f", relMSE {result.error:.3g}"
            self._line(f"done: {result.name} ({_time(result.seconds)}{error}; {self.summary()})")

    def _Note(self, event: Event) -> None:  # noqa: N802
        self._line(f"note: {event.text}", "yellow")  # type: ignore[union-attr]

    # ── what is shown ────────────────────────────────────────────────────────────────────────────────────────────────

    def summary(self) -> str:
        """Numbers of jobs, rate and time left, in one line."""
        over = sum(self._states.values())
        of = f" of {self.jobs}" if self.jobs else ""
        running = len({row.job for row in self._workers.values() if row.job})
        parts = [f"{self._states['done']}{of} done", f"{running} running", f"{self._states['failed']} failed"]
        passed = self.now() - (self.now() if self._begun is None else self._begun)
        if over and passed > 0:
            parts.append(f"{60 * over / passed:.3g} a minute")
            if over < self.jobs:
                parts.append(f"{_time((self.jobs - over) * passed / over)} left")
        return " · ".join(parts)

    def render(self) -> RenderableType:
        """Summary, and a row for each worker."""
        with self._lock:
            over = sum(self._states.values())
            bar = ProgressBar(total=max(self.jobs, over, 1), completed=over)
            table = Table(box=None, pad_edge=False, header_style="dim", expand=True)
            table.add_column("worker", no_wrap=True)
            table.add_column("job", no_wrap=True, ratio=1, overflow="ellipsis")  # takes what the others leave
            table.add_column("", no_wrap=True)
            table.add_column("running for", no_wrap=True)
            table.add_column("ended", no_wrap=True, justify="right")
            shown = list(self._workers.items())[:MOST_ROWS]
            for name, row in shown:
                table.add_row(*self._row(name, row))
            more = len(self._workers) - len(shown)
            rest = [Text(f"and {more} more workers", style="dim")] if more else []
            line = Table.grid(expand=True)  # a bar by itself would end no line
            line.add_row(bar)
            return Group(Text(self.summary(), style="bold"), line, table, *rest)

    def _row(self, name: str, row: _Worker) -> tuple[RenderableType, ...]:
        if not row.job:
            return printable(name), Text("waits", style="dim"), "", "", str(row.ended)
        passed = self.now() - row.since
        job = Text(printable(f"{row.job} ({row.part})" if row.part else row.job))
        slow = Text("  slow", style="yellow") if self._is_slow(row) else Text("")
        return printable(name), job, f"{row.share:4.0%}", Text(_time(passed)) + slow, str(row.ended)

    def _is_slow(self, row: _Worker) -> bool:
        passed = self.now() - row.since
        return bool(row.job) and self._longest > 0 and passed > max(LEAST_SLOW, SLOW * self._longest)

    def _tell_slow(self) -> None:
        """Say once where no table shows it that a job takes long."""
        for name, row in self._workers.items():
            if not row.told_slow and not self.console.is_terminal and self._is_slow(row):
                row.told_slow = True
                passed, longest = _time(self.now() - row.since), _time(self._longest)
                self._line(f"note: {row.job} runs on {name} for {passed}; the longest so far took {longest}")

    def _line(self, text: str, style: str = "") -> None:
        self.console.print(Text(printable(text), style=style), soft_wrap=True)


def _time(seconds: float) -> str:
    """Time in the largest unit that it has more than one of.

    Examples
    --------
    >>> [_time(value) for value in (3.21, 200.0, 10_000.0, 400_000.0)]
    ['3.2 s', '3.3 min', '2.8 h', '4.6 days']
    """
    for unit, size in (("s", 60.0), ("min", 60.0), ("h", 48.0)):
        if seconds < size:
            return f"{seconds:.2g} {unit}" if seconds < 10 else f"{seconds:.0f} {unit}"
        seconds /= 24.0 if unit == "h" else size
    return f"{seconds:.2g} days"
