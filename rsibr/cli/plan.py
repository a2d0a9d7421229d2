"""`rsibr plan`: effects that a scene needs, and their costs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import typer

from rsibr.cli.options import Config, Imports, Json, Overrides, imported

if TYPE_CHECKING:
    from rsibr.planning.plan import Effect, LobePlan, Plan


def plan(
    config: Config,
    overrides: Overrides = None,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Show which effects a scene needs, with evidence, cost, and the error of leaving each out. Bakes nothing."""
    from rsibr.baking.plan_document import PlanDocument
    from rsibr.budget.bake import planned
    from rsibr.cli.promises import chosen_lines
    from rsibr.scene.config import load_config

    made, sampling, budget = planned(load_config(config, overrides or ()).with_plugins(imported(imports)))
    if json_output:
        typer.echo(PlanDocument.of(made, sampling, budget).to_json(), nl=False)
        return
    _print(made)
    for line in chosen_lines(sampling, budget):
        typer.echo(line)


def _print(made: Plan) -> None:
    print_effects(made.effects)
    for line in _lines(made):
        typer.echo(line)


def print_effects(effects: Iterable[Effect]) -> None:
    """Print a table of effects: those of a bake, or of an object (`ObjectPlan.effects`)."""
    from rsibr.cli.table import new_table, print_table

    table = new_table("effect", "", "evidence", "threshold", "s", "MiB", "relMSE without")
    table.add_column("why", overflow="fold", min_width=40)
    for effect in effects:
        table.add_row(*_row(effect), style=None if effect.on else "yellow" if effect.missed else "dim")
    print_table(table)


def _row(effect: Effect) -> Iterator[str]:
    from rsibr.planning.plan import number

    sign = "" if effect.on else "−"
    seconds, size = (
        (effect.cost_seconds, effect.cost_bytes) if effect.on else (effect.saved_seconds, effect.saved_bytes)
    )
    yield effect.name
    yield ("on" if effect.on else "off") + (" (as set)" if effect.forced else "")
    yield number(effect.evidence)
    yield number(effect.threshold)
    yield "?" if seconds is None else f"{sign}{seconds:.2f}" if seconds else "0"
    yield "?" if size is None else f"{sign}{size / 2**20:.2f}" if size else "0"
    yield "?" if effect.error_if_left_out is None else number(effect.error_if_left_out)
    yield f"{effect.why} [{effect.unit}]"


def _fit(lobe: LobePlan) -> str:
    """Clause on the error of a lobe's fit at the worst angle."""
    if not lobe.fit_errors:
        return ""
    worst, angle = max(zip(lobe.fit_errors, lobe.fit_angles, strict=True))
    return f"; its fit errs by {100 * worst:.1f} % at most, at {angle:.0f}°"


def _lines(made: Plan) -> Iterator[str]:
    for lobe in made.lobes:
        needs = f"maps from {lobe.views_needed} views" if lobe.maps_needed else "no maps"
        apart = "" if lobe.own_views is None else f", stored separately in the first {lobe.own_views} views"
        yield f"{lobe.name}: {needs}{apart}: {lobe.why}{_fit(lobe)}"
    channels, samples = ("one channel" if made.grey else "RGB"), ("light and BSDF" if made.light_samples else "BSDF")
    channels += {"rgb": "", "spectral": " of spectra", "spectral_polarized": " of polarised spectra"}[made.rendering]
    total = (
        "" if made.seconds is None or made.bytes is None else f", {made.seconds:.1f} s, {made.bytes / 2**20:.1f} MiB"
    )
    yield f"planned: maps of {made.resolution}², {channels}, samples of {samples}{total}"
    yield f"costs {made.costs_from}; probing the scene took {made.probe_seconds:.2f} s"
    for note in made.notes():
        yield f"note: {note}"
