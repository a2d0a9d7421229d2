"""`rsibr study`: error against time, over sweeps of the parameters of a bake."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsibr.cli.options import Imports, Json, Yes, check_output_folder, imported
from rsibr.cli.streams import plain
from rsibr.errors import printable

if TYPE_CHECKING:
    from rsibr.progress import Progress
    from rsibr.studies.runner import Study


def study(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="Config of the study (TOML).", show_default=False)],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Directory of the study, for report, bakes and references.")],
    allow_large: Yes = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Measure accuracy against time: sweeps, convergence, Pareto fronts. A killed study resumes."""
    check_output_folder(out)
    from rsibr.cli.job import note_job
    from rsibr.studies.config import load_study
    from rsibr.studies.runner import study as run

    settings = load_study(config).with_plugins(imported(imports))
    with _progress() as show:
        found = run(settings, out=out, on_progress=show, on_forecast=note_job, allow_large=allow_large)
    if json_output:
        typer.echo((out / "study.json").read_text(encoding="utf-8"), nl=False)
    else:
        _print(found)


@contextmanager
def _progress() -> Iterator[Callable[[Progress], None]]:
    """Print the expected time of the study, then show the current step and the remaining time."""
    from rsibr.cli.console import say, time_progress
    from rsibr.validation.report.page import duration

    with time_progress("study") as bar:
        begun = False

        def show(state: Progress) -> None:
            nonlocal begun
            if not begun:
                say(f"expected to take {duration(state.total)}" if state.total > 0 else "already complete")
                begun = True
            bar(state)

        yield show


def _print(found: Study) -> None:
    """Print each scene's Pareto front of error and time, gains by class of material, and the gain of twice the time."""
    lines = "\n".join(_scene_lines(found))
    if lines:
        typer.echo(lines)
    from rsibr.cli.study_classes import print_classes
    from rsibr.studies.page import answer
    from rsibr.validation.report.page import duration

    document = found.document
    print_classes(document.classes)
    if document.doubling:
        typer.echo("\ngain of doubling the time, mean over the scenes")
    for sentence in answer(document.doubling, document.judge.frames):
        typer.echo(f"  {plain(sentence)}")
    typer.echo(plain(f"forecast {duration(document.expected_seconds)}, took {duration(document.seconds)}"))
    typer.echo(f"report: {printable(found.out / 'study.html')}")


def _scene_lines(found: Study) -> Iterator[str]:
    """Yield the Pareto front of each scene; an empty line between two scenes."""
    from rsibr.studies.page import estimate
    from rsibr.validation.report.page import duration, number, size

    frames = found.document.judge.frames
    for index, (scene, analysis) in enumerate(found.scenes):
        if index:
            yield ""
        yield plain(f"{scene.name}: Pareto front of relMSE and time, for bake, preparation and {frames} images")
        by_label = {point.label: point for point in scene.points}
        rivals = {row.label: row for row in analysis.rivals}
        for label in analysis.job_front:
            point, row = by_label[label], rivals[label]
            yield plain(
                f"  {duration(row.job_seconds):>12}  relMSE {estimate(point.error.rel_mse):<22}"
                f"{size(point.bytes):>9}  {label} (path tracing: {number(row.path_tracing_rel_mse)})"
            )
