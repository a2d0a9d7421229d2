"""Tables of commands on stdout."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

TABLE_WIDTH = 150
"""Minimum width of a table, in characters."""


def print_table(table: Table, width: int = TABLE_WIDTH) -> None:
    """Print a table as it stands, without markup and highlighting, at least `width` characters wide."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    console.width = max(console.width, width)  # without a terminal Rich assumes a narrow one
    console.print(table)
