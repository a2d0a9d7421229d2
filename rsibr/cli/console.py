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

from rsibr.cli.streams import plain
from rsibr.cli.verbosity import is_quiet, is_verbose
from rsibr.progress import BAKE, Job, Progress, as_progress
from rsibr.publishing.progress.bars import ProgressBars
from rsibr.publishing.progress.lines import ProgressLines
from rsibr.store.notes import peculiarities, suspicions

if TYPE_CHECKING:
    from rsibr.methods.reconstruction import Reconstruction
    from rsibr.store.bake import Bake

console = Console(stderr=True, highlight=False, markup=False)


def say(text: str) -> None:
    """Print a line on stderr, unless `--quiet`."""
    if not is_quiet():
        console.print(plain(text), soft_wrap=True)


def note(text: str) -> None:
    """Print a note on stderr, unless `--quiet`."""
    say(f"note: {text}")


@contextmanager
def bake_progress() -> Iterator[Callable[[Progress], None]]:
    """Show two progress bars, for the whole bake and the current view, each with its remaining time; or lines."""
    with _progress(BAKE) as show:
        yield show


@contextmanager
def step_progress(name: str) -> Iterator[Callable[[int, int], None]]:
    """Show the progress through a number of equal steps, as a bar or as lines."""
    with _progress(Job(name)) as show:
        yield lambda done, total: show(as_progress(done, total))


@contextmanager
def time_progress(name: str) -> Iterator[Callable[[Progress], None]]:
    """Show the progress of a job whose work is counted in expected seconds, as a bar or as lines."""
    with _progress(Job(name, "")) as show:
        yield show


@contextmanager
def _progress(job: Job) -> Iterator[Callable[[Progress], None]]:
    if console.is_terminal and not console.is_dumb_terminal and not is_quiet():
        drawn = ProgressBars(job, console)
        with drawn.bars:
            yield drawn.show
    else:
        lines = ProgressLines(job.name, job.unit, say, every=is_verbose())  # with --quiet `say` says nothing
        yield lambda state: lines.show(state.done, state.total, state.step)


def note_peculiarities(bake: Bake) -> None:
    """Print notes on the material, the environment, effects that were forced off, and clipped values."""
    for text in peculiarities(bake.manifest):
        note(text)


def note_health(bake: Bake) -> None:
    """Print the number of suspicious texels of each kind, if there are any."""
    for text in suspicions(bake.manifest, bake.path):
        note(text)


def note_non_finite(map_: Reconstruction) -> None:
    """Print the number of texels of a reconstruction that are not finite, if there are any."""
    count = int((~np.isfinite(map_.image).all(axis=-1)).sum())
    if count:
        note(f"{count} texels are not finite (NaN or infinite)")
