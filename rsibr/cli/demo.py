"""`rsibr demo`: a small example of the whole pipeline, from bake to report and page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.options import Imports, Json, Yes, check_output_folder, imported
from rsibr.cli.validate import print_validation
from rsibr.cli.verbosity import is_verbose
from rsibr.errors import printable

VIEWS = 8
SAMPLES = 512
PAGE_NAME = "view.html"


def demo(
    out: Annotated[Path, typer.Option(help="Directory for the bake, the report and the page.")] = Path("out/demo"),
    allow_large: Yes = False,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Bake a car paint under a real sky, reconstruct novel views, compare with path tracing, write report and page."""
    from rsibr import clock
    from rsibr.baking.baker import bake
    from rsibr.baking.finished import finished_bake, is_outdated
    from rsibr.baking.scene import Scene
    from rsibr.cli.console import bake_progress, note_peculiarities, say, step_progress
    from rsibr.cli.job import note_job
    from rsibr.publishing.page import write_page
    from rsibr.resources import configs
    from rsibr.scene.config import load_config
    from rsibr.validation.validation import validate

    check_output_folder(out)
    settings = load_config(configs() / "demo.toml").with_plugins(imported(imports))
    path = out / "paint.rsibr"
    known = finished_bake(settings, path)
    with clock.counting(), bake_progress() as show:
        scene = Scene.prepare(settings)
        baked = known or bake(
            scene,
            out=path,
            fresh=is_outdated(settings, path),
            on_progress=show,
            on_forecast=note_job,
            allow_large=allow_large,
        )
    if known is None or is_verbose():
        note_peculiarities(baked)
    done = "baked" if known is None else "already baked:"
    say(f"{done} {baked.view_count} views of {baked.resolution}² in {baked.seconds:.1f} s: {baked.path}")
    with step_progress("validate") as step:
        found = validate(
            baked, views=VIEWS, samples=SAMPLES, out=out, on_progress=step, scene=scene, allow_large=allow_large
        )
    page = write_page(baked, out / PAGE_NAME, reference=out)
    print_validation(found, out, json_output=json_output)
    if not json_output:
        typer.echo(f"page: {printable(page)}, {page.stat().st_size / 2**20:.1f} MiB: open it in a browser")
