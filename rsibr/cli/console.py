"""Progress and notes of commands, all on stderr; stdout is reserved for results.

On a terminal progress is a bar, elsewhere (a file, a pipe, `TERM=dumb`) lines. Lines are never wrapped: a terminal
does that by itself, and a log keeps them whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import TimeRemainingColumn as TimeLeftColumn

from rsibr.cli.progress_lines import ProgressLines
from rsibr.cli.streams import plain
from rsibr.cli.verbosity import is_quiet, is_verbose

if TYPE_CHECKING:
    from rsibr.methods.reconstruction import Reconstruction
    from rsibr.progress import Progress as Work
    from rsibr.store.bake import Bake

VIEW_STEPS = 16
"""Steps of the progress bar of a view."""

console = Console(stderr=True, highlight=False, markup=False)


def say(text: str) -> None:
    """Print a line on stderr, unless `--quiet`."""
    if not is_quiet():
        console.print(plain(text), soft_wrap=True)


def note(text: str) -> None:
    """Print a note on stderr, unless `--quiet`."""
    say(f"note: {text}")


@contextmanager
def bake_progress() -> Iterator[Callable[[Work], None]]:
    """Show two progress bars, for the whole bake and the current view, each with its remaining time; or lines."""
    if not _shows_bars():
        lines = _lines("bake", "views")
        yield lambda state: lines(state.done, state.total, state.step)
        return
    with _bars() as bars:
        whole: TaskID | None = None
        view: TaskID | None = None
        step = ""

        def show(state: Work) -> None:
            nonlocal whole, view, step
            if whole is None or view is None:  # the bar starts with the views of earlier runs
                whole = bars.add_task("bake", total=state.total, completed=int(state.done))
                view = bars.add_task("view", total=VIEW_STEPS)
            bars.update(whole, completed=state.done)
            if state.step != step:
                step = state.step
                bars.reset(view, description=step, total=VIEW_STEPS)
            bars.update(view, completed=round(state.share * VIEW_STEPS))

        yield show


@contextmanager
def step_progress(name: str) -> Iterator[Callable[[int, int], None]]:
    """Show the progress through a number of equal steps, as a bar or as lines."""
    if not _shows_bars():
        yield _lines(name, "steps")
        return
    with _bars() as bars:
        task: TaskID | None = None

        def show(done: int, total: int) -> None:
            nonlocal task
            if task is None:
                task = bars.add_task(name, total=total)
            bars.update(task, completed=done)

        yield show


@contextmanager
def time_progress(name: str) -> Iterator[Callable[[Work], None]]:
    """Show the progress of a job whose work is counted in expected seconds, as a bar or as lines."""
    if not _shows_bars():
        lines = _lines(name, "")
        yield lambda state: lines(state.done, state.total, state.step)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("left"))
    with Progress(*columns, TimeLeftColumn(), console=console, transient=True) as bars:
        task: TaskID | None = None

        def show(state: Work) -> None:
            nonlocal task
            if task is None:
                task = bars.add_task(name, total=state.total)
            bars.update(task, completed=state.done, description=state.step)

        yield show


def note_peculiarities(bake: Bake) -> None:
    """Print notes on the material, the environment, effects that were forced off, and clipped values."""
    for text in bake.manifest.material.notes:
        note(f"{bake.manifest.material.name}: {text}")
    for text in bake.manifest.plan.notes() if bake.manifest.plan else ():
        note(text)
    environment = bake.manifest.environment
    if environment.clipped:
        note(
            f"{environment.name}: {environment.clipped} negative values clipped to 0 "
            f"(the lowest was {environment.lowest:.2g})"
        )


def note_health(bake: Bake) -> None:
    """Print the number of suspicious texels of each kind, if there are any."""
    records = [state.health for state in bake.manifest.views if state.health is not None]
    counts = {
        "non-finite": sum(record.non_finite for record in records),
        "missing": sum(record.holes for record in records),
        "firefly": sum(record.fireflies for record in records),
        "half-float overflow": sum(record.half_overflow for record in records),
    }
    found = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    if found:
        note(f"suspicious texels: {found}. `rsibr check {bake.path}` lists them")


def note_non_finite(map_: Reconstruction) -> None:
    """Print the number of texels of a reconstruction that are not finite, if there are any."""
    count = int((~np.isfinite(map_.image).all(axis=-1)).sum())
    if count:
        note(f"{count} texels are not finite (NaN or infinite)")


def _shows_bars() -> bool:
    return console.is_terminal and not console.is_dumb_terminal and not is_quiet()


def _lines(name: str, unit: str) -> Callable[..., None]:
    """Progress as lines; nothing with `--quiet`."""
    return ProgressLines(name, unit, say, every=is_verbose()).show


def _bars() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeLeftColumn(),
        console=console,
        transient=True,
    )
