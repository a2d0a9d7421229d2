"""The table of `rsibr study` by class of material."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import typer

from rsibr.errors import printable

if TYPE_CHECKING:
    from rsibr.studies.classes import ClassRecord

COLUMNS = ("class", "pairs", "whole disk", "r < 2/3", "r > 2/3", "energy", "worst pair", "errs most in · worst texel")


def print_classes(classes: Sequence[ClassRecord]) -> None:
    """Print a table for each method, its worst class first, each with its worst pair."""
    from rsibr.cli.table import new_table, print_table
    from rsibr.methods.registry import baseline_method
    from rsibr.studies.page import gains, place
    from rsibr.validation.report.page import number

    for method, rows in groupby(classes, key=lambda row: row.method):
        typer.echo(
            f"\n{method}: relMSE of {baseline_method()} over its own, geometric mean · least, the worst class on top"
        )
        table = new_table(*COLUMNS)
        for row in rows:
            parts = (gains(row.gain), gains(row.gain_inner), gains(row.gain_outer))
            name = "all" if row.material_class is None else printable(row.material_class)
            table.add_row(
                name, str(row.pairs), *parts, number(row.energy_ratio, 4), printable(row.worst.name), place(row.worst)
            )
        print_table(table)
