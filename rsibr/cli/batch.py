"""`rsibr batch`: many bakes, one machine or many."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsibr.cli.options import Json, Yes, check_output_folder
from rsibr.errors import InputError, printable

if TYPE_CHECKING:
    from rsibr.batches.document import ForecastRecord
    from rsibr.batches.report import BatchReport

MOST_KINDS = 20
"""Kinds of jobs that a forecast lists."""


def batch(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Batch file (TOML).", show_default=False)],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Directory of the batch; by default FILE's name with .batch.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check every job and forecast time, bytes and files; bake nothing.")
    ] = False,
    no_probe: Annotated[
        bool, typer.Option("--no-probe", help="Forecast from typical rates: no job is measured, Mitsuba not loaded.")
    ] = False,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the base; repeatable.")
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUE", help="Only jobs with this value, or of this name=PATTERN; repeatable."),
    ] = None,
    executor: Annotated[
        str | None, typer.Option(metavar="NAME", help="serial, processes or dask; by default the file's.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Address of a Dask scheduler, or local.")
    ] = None,
    shard: Annotated[
        str | None, typer.Option(metavar="I/N", help="Part I of N of the jobs, for array jobs of a cluster.")
    ] = None,
    reindex: Annotated[
        bool, typer.Option("--reindex", help="Make index and gallery anew from the results; bake nothing.")
    ] = False,
    allow_large: Yes = False,
    json_output: Json = False,
) -> None:
    """Bake all combinations of a matrix. What is done does not run again; a failed job exits with 1."""
    place = out or Path(f"{file.stem}.batch")
    check_output_folder(place)
    from rsibr.batches.batch import batch as run
    from rsibr.batches.batch import reindex as run_reindex
    from rsibr.cli.batch_table import BatchTable
    from rsibr.cli.console import console, say, time_progress

    if reindex:
        report = run_reindex(place, file.stem)
    else:
        with ExitStack() as checking, BatchTable(console) as table:
            show = checking.enter_context(time_progress("check"))

            def begin(found: ForecastRecord) -> None:
                checking.close()  # the bars of the checks, before the table
                if not dry_run:
                    table.jobs = found.jobs
                    say(printable(_forecast_line(found)))

            report = run(
                file,
                out=place,
                overrides=overrides or (),
                only=only or (),
                executor=executor,
                scheduler=scheduler,
                shard=parse_shard(shard),
                dry_run=dry_run,
                probe=not no_probe,
                on_progress=show,
                on_forecast=begin,
                on_event=table,
                allow_large=allow_large,
            )
    typer.echo(report.document.to_json()) if json_output else _print(report)
    raise typer.Exit(int(bool(report.failed)))


def parse_shard(text: str | None) -> tuple[int, int] | None:
    """Parse `I/N`.

    Raises
    ------
    InputError
        If it is not two whole numbers with 1 ≤ I ≤ N.
    """
    if text is None:
        return None
    number, slash, of = text.partition("/")
    if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
        raise InputError(f"'{text}' is no part of a whole", where="--shard", fix="give I/N with 1 ≤ I ≤ N, as in 3/16")
    return int(number), int(of)


def _forecast_line(found: ForecastRecord) -> str:
    from rsibr.job_size import in_bytes

    by = "measured by small jobs" if found.source == "probes" else "by typical rates"
    jobs = f"{found.jobs} job{'' if found.jobs == 1 else 's'}"
    return (
        f"{jobs}: {found.processor_seconds / 3600:.3g} core-hours, {_time(found.seconds)} on this machine "
        f"({found.executor}, {found.workers} × {found.threads} threads), {in_bytes(found.bytes)} in "
        f"{found.files} files, {in_bytes(found.free_bytes)} are free; {by}"
    )


def _time(seconds: float) -> str:
    """Time in the largest unit that it has more than one of: `12.3 s`, `3.4 min`, `7.2 h`, `41 days`."""
    for unit, size in (("s", 60.0), ("min", 60.0), ("h", 48.0)):
        if seconds < size:
            return f"{seconds:.3g} {unit}"
        seconds /= 24.0 if unit == "h" else size
    return f"{seconds:.3g} days"


def _print(report: BatchReport) -> None:
    from rsibr.job_size import in_bytes

    document = report.document
    if document.state == "forecast" and document.forecast is not None:
        _print_forecast(document.forecast)
        return
    already = f", {document.already_done} of them before" if document.already_done else ""
    typer.echo(
        f"{printable(report.out)}: {document.done} of {document.jobs} jobs done{already}, "
        f"{document.processor_seconds / 3600:.3g} core-hours, {in_bytes(document.bytes)}"
    )
    for path in document.damaged:
        typer.echo(f"damaged result: {printable(path)}")
    for path in (*document.index, *filter(None, [document.gallery])):
        typer.echo(f"written: {printable(path)}")
    for failed in report.failed:
        ended = f" ({failed.signal})" if failed.signal else ""
        typer.echo(printable(f"failed: {failed.name}: {failed.reason}{ended}"))
        if failed.command:
            typer.echo(printable(f"  again: {failed.command}"))


def _print_forecast(found: ForecastRecord) -> None:
    from rich.table import Table

    from rsibr.cli.table import print_table
    from rsibr.job_size import in_bytes

    typer.echo(f"{found.materials} materials, {found.skies} skies, {found.already_done} jobs are done already")
    table = Table(title="Kinds of jobs", title_justify="left")
    for name in ("material", "views", "side", "samples", "jobs", "processor time of one", "bytes of one"):
        table.add_column(name, justify="left" if name == "material" else "right")
    for kind in found.kinds[:MOST_KINDS]:
        sizes = map(str, (kind.views, kind.resolution, kind.samples, kind.jobs))
        table.add_row(printable(kind.material), *sizes, _time(kind.processor_seconds), in_bytes(kind.bytes))
    print_table(table)
    if len(found.kinds) > MOST_KINDS:
        typer.echo(f"and {len(found.kinds) - MOST_KINDS} more kinds")
    typer.echo(printable(_forecast_line(found)))
    for note in found.notes:
        typer.echo(printable(f"note: {note}"))
