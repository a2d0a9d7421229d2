"""`rsibr bake`: render the radiance sphere maps of a config."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.options import Config, Imports, Json, Overrides, Yes, check_output_folder, imported
from rsibr.cli.verbosity import is_verbose
from rsibr.errors import printable


def bake(
    config: Config,
    out: Annotated[
        Path | None, typer.Option(help="Directory of the bake; by default CONFIG's name with the suffix .rsibr.")
    ] = None,
    overrides: Overrides = None,
    clamp: Annotated[
        float | None,
        typer.Option(help="Clamp the radiance of samples: less noise, and a negative bias that `check` reports."),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Start over, even if OUT holds another bake.")] = False,
    allow_large: Yes = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Render the radiance sphere maps of all views. A killed bake resumes. A promise that is broken exits with 1."""
    from rsibr.baking.finished import finished_bake
    from rsibr.budget.bake import bake as run_bake
    from rsibr.budget.promise import promises_of
    from rsibr.cli.console import bake_progress, note_health, note_peculiarities
    from rsibr.cli.job import note_job
    from rsibr.cli.promises import exit_code, promises, reached_lines
    from rsibr.scene.config import load_config

    overrides = [*(overrides or ()), *(() if clamp is None else (f"sampling.clamp={clamp}",))]

    settings = load_config(config, overrides).with_plugins(imported(imports))
    path = out or Path(f"{config.stem}.rsibr")
    known = None if fresh else finished_bake(settings, path)
    if known is None:
        check_output_folder(path)
    if known is not None:
        finished = known
    else:
        with bake_progress() as show:
            finished = run_bake(
                settings, out=path, fresh=fresh, on_progress=show, on_forecast=note_job, allow_large=allow_large
            )
    if known is None or is_verbose():  # a complete bake has said its notes when it was made
        note_peculiarities(finished)
        note_health(finished)
    if json_output:
        state = {
            "bake": str(finished.path),
            "already_complete": known is not None,
            "views": finished.view_count,
            "resolution": finished.resolution,
            "seconds": finished.seconds,
            "bytes": finished.bytes,
            "config_hash": finished.manifest.config_hash,
            "environment": finished.manifest.environment.model_dump(),
            **promises(finished.manifest),
        }
        typer.echo(json.dumps(state))
    else:
        complete = "" if known is None else "already complete, "
        typer.echo(
            f"{printable(finished.path)}: {complete}{finished.view_count} views of {finished.resolution}², "
            f"{finished.seconds:.1f} s, {finished.bytes / 2**20:.1f} MiB"
        )
        for line in reached_lines(finished.manifest):
            typer.echo(line)
    raise typer.Exit(exit_code(promises_of(finished.manifest)))
