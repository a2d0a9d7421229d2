"""Tables of commands on stdout, never cut off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from rich.table import Table


def new_table(*headings: str, title: str | None = None) -> Table:
    """Make a table with a line below its headings and no frame; columns keep their width."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, title=title, title_justify="left")
    for heading in headings:
        table.add_column(heading, no_wrap=True)
    return table


def print_table(table: Table) -> None:
    """Print a table as it stands, without markup and highlighting.

    On a terminal, columns that may be wrapped are wrapped to its width. Elsewhere each row is one line, however wide.
    """
    from rich.console import Console
    from rich.measure import Measurement

    console = Console(highlight=False, markup=False)
    bounds = Measurement.get(console, console.options.update(width=_WIDEST, max_width=_WIDEST), table)
    if console.is_terminal:
        console.width = max(console.width, bounds.minimum)
        console.print(table)
        return
    console.width = bounds.maximum
    with console.capture() as captured:
        console.print(table)
    for line in captured.get().splitlines():
        typer.echo(line.rstrip())


_WIDEST = 100_000  # characters, more than any table has
