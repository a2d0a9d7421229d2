"""Progress in the cell of a notebook: drawn in place, and gone when the job is done.

Rich draws in notebooks by ipywidgets, of which a stored notebook keeps a dead frame. One output that is replaced needs
no further package.
"""

from __future__ import annotations

import importlib
import io
import time
from collections.abc import Sequence
from html import escape
from typing import Any

from rich.console import Console

from rsibr.progress import Job, Progress
from rsibr.publishing.progress.bars import ProgressBars

PERIOD = 0.2
"""Least time between two drawings [s]."""

MARK = "rsibr-progress"
"""CSS class by which outputs are told that are of no use once the job is done."""

_COLUMNS = 92
_BARS = f'<pre class="{MARK}" style="white-space:pre;line-height:1.3;margin:0">{{code}}</pre>'
_FAINT = "color:#888;font-size:90%"


class NotebookDisplay:
    """Bars of a job in the output of the cell, inside of the block, and notes below."""

    def __init__(self, job: Job) -> None:
        self._bars = ProgressBars(job, Console(file=io.StringIO(), force_jupyter=False))
        self._name = job.name
        self._handle: Any = None
        self._drawn = -PERIOD

    def __enter__(self) -> NotebookDisplay:
        """Show that the job has begun."""
        self._handle = _display(_html(f"{self._name}: preparing"), display_id=True)
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bars away."""
        self._handle.update({"text/html": f'<span class="{MARK}"></span>', "text/plain": ""}, raw=True)

    def show(self, state: Progress) -> None:
        """Draw a state of the job, unless the one before is fresh."""
        self._bars.show(state)
        if time.monotonic() - self._drawn >= PERIOD:
            self._drawn = time.monotonic()
            self._handle.update(_html(self._bars.bars.get_renderable()), raw=True)

    def say(self, notes: Sequence[str]) -> None:
        """Show notes, which remain."""
        lines = [f"note: {text}" for text in notes]
        html = f'<div style="{_FAINT}">{"<br>".join(escape(line) for line in lines)}</div>'
        _display({"text/html": html, "text/plain": "\n".join(lines)})


def _html(drawing: Any) -> dict[str, str]:
    """Drawing of Rich as HTML, and as text for frontends that show none."""
    console = Console(
        file=io.StringIO(),
        record=True,
        width=_COLUMNS,
        force_terminal=True,
        force_jupyter=False,  # else Rich adds an output of its own
        color_system="truecolor",
        markup=False,
    )
    console.print(drawing, highlight=False)
    text = console.export_text(clear=False).rstrip()
    return {"text/html": console.export_html(inline_styles=True, code_format=_BARS).rstrip(), "text/plain": text}


def _display(data: dict[str, str], **options: Any) -> Any:
    return importlib.import_module("IPython.display").display(data, raw=True, **options)
