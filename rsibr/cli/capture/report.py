"""What a subcommand of `rsibr capture` says at its end: notes on stderr, the result on stdout."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from rsibr.errors import printable


def report(out: Path, line: str, facts: Mapping[str, Any], notes: Sequence[str], *, json_output: bool) -> None:
    """Print a result.

    Parameters
    ----------
    out : Path
        File that was written.
    line : str
        Result in words.
    facts : mapping
        Result for machines, without `file` and `notes`.
    notes : sequence of str
        What the user should know.
    json_output : bool
        Whether one JSON object is printed in place of the line.
    """
    from rsibr.cli.console import note

    for one in notes:
        note(one)
    if json_output:
        typer.echo(json.dumps({"file": str(out), **facts, "notes": list(notes)}))
    else:
        typer.echo(f"{printable(out)}: {line}")
