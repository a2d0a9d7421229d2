"""Where a call from Python shows its progress: in the notebook's cell, in the terminal, or as lines on stderr."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

from rich.console import Console

from rsibr.errors import printable
from rsibr.progress import Job, Progress
from rsibr.publishing.progress.bars import ProgressBars
from rsibr.publishing.progress.lines import ProgressLines
from rsibr.publishing.progress.notebook import NotebookDisplay
from rsibr.shown_progress import shell


class Display(Protocol):
    """Something that shows progress and notes."""

    def show(self, state: Progress) -> None:
        """Show a state of the job."""

    def say(self, notes: Sequence[str]) -> None:
        """Show notes, which remain."""


def displayed(job: Job) -> AbstractContextManager[Display]:
    """Display of a job, inside of the block; notes may follow it."""
    return NotebookDisplay(job) if hasattr(shell(), "kernel") else _on_stderr(job)


@contextmanager
def _on_stderr(job: Job) -> Iterator[Display]:
    console = Console(stderr=True, highlight=False, markup=False)
    if console.is_terminal and not console.is_dumb_terminal:
        drawn = ProgressBars(job, console)
        with drawn.bars:
            yield _Streamed(console, drawn)
    else:
        yield _Streamed(console, ProgressLines(job.name, job.unit, lambda line: console.print(line, soft_wrap=True)))


class _Streamed:
    """Progress and notes on stderr."""

    def __init__(self, console: Console, drawn: ProgressBars | ProgressLines) -> None:
        self._console, self._drawn = console, drawn

    def show(self, state: Progress) -> None:
        if isinstance(self._drawn, ProgressBars):
            self._drawn.show(state)
        else:
            self._drawn.show(state.done, state.total, state.step)

    def say(self, notes: Sequence[str]) -> None:
        for text in notes:
            self._console.print(f"note: {printable(text)}", soft_wrap=True)
