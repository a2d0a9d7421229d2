"""Progress as bars: of a whole job and, where it is known, of its current step."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import TimeRemainingColumn as TimeLeftColumn

from rsibr.progress import Job
from rsibr.progress import Progress as Work

STEP_PARTS = 16
"""Parts of the bar of a step."""


class ProgressBars:
    """Bars of a job, each with its elapsed time and the time that is left.

    Parameters
    ----------
    job : Job
        What is counted.
    console : rich.console.Console
        Where the bars are drawn.

    Attributes
    ----------
    bars : rich.progress.Progress
        As a context it draws the bars, again and again, and takes them away at the end.
    """

    def __init__(self, job: Job, console: Console) -> None:
        self._job = job
        counted: tuple[ProgressColumn, ...] = (MofNCompleteColumn(),) if job.unit else ()
        times = (TimeElapsedColumn(), TextColumn("left"), TimeLeftColumn())
        self.bars = Progress(TextColumn("{task.description}"), BarColumn(), *counted, *times, console=console)
        self.bars.live.transient = True
        self._whole: TaskID | None = None
        self._part: TaskID | None = None
        self._step = ""

    def show(self, state: Work) -> None:
        """Draw a state of the job."""
        if self._whole is None:  # the bar starts with the work of earlier runs
            self._whole = self.bars.add_task(self._job.name, total=state.total, completed=int(state.done))
        name = self._job.name if self._job.unit else state.step
        self.bars.update(self._whole, completed=state.done, description=name)
        if self._job.has_parts:
            self._show_part(state)

    def _show_part(self, state: Work) -> None:
        if self._part is None:
            self._part = self.bars.add_task(state.step, total=STEP_PARTS)
        elif state.step != self._step:
            self.bars.reset(self._part, description=state.step, total=STEP_PARTS)
        self._step = state.step
        self.bars.update(self._part, completed=round(state.share * STEP_PARTS))
