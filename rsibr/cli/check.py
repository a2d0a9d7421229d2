"""`rsibr check`: check a bake for numerical problems."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rsibr.cli.options import BakePath, Imports, Json, check_output_folder, imported
from rsibr.errors import printable

if TYPE_CHECKING:
    from rsibr.validation.health.health import CaptureHealth, Finding, Health, Place

NAMED = 3
"""Maximum number of printed places of a kind; `health.json` holds more."""


def check(
    bake: BakePath,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Directory for health.html, health.json and images.")
    ] = None,
    imports: Imports = None,
    json_output: Json = False,
) -> None:
    """Check a bake for NaN, holes, fireflies, energy drift and half-float overflow; exit code 1 for the first two."""
    if out is not None:
        check_output_folder(out)
    imported(imports)
    from rsibr.validation.health.check import check as run
    from rsibr.validation.health.health_document import HealthModel

    health = run(bake, out=out)
    if json_output:
        typer.echo(HealthModel.of(health).to_json(), nl=False)
    else:
        for line in _lines(health):
            typer.echo(line)
        if out is not None:
            typer.echo(f"report: {printable(out / 'health.html')}")
    raise typer.Exit(0 if health.trusted else 1)


def _lines(health: Health) -> Iterator[str]:
    found = [finding for finding in health.findings.values() if finding.texels]
    verdict = "unusable" if not health.trusted else "warnings" if health.warnings else "nothing found"
    yield f"{printable(health.bake)}: {verdict} ({health.views} views, {health.texels} texels)"
    for finding in found:
        yield from _finding(finding)
    for drift in health.drifts:
        yield f"warning: view {drift.view} has {drift.ratio:.3f} × the {drift.channel} radiance that the others predict"
    for view in health.above_light:
        yield f"warning: the mean radiance of view {view} exceeds the maximum of the environment"
    if health.capture is not None:
        yield from _capture(health.capture)
    if health.energy_note and health.capture is None:
        yield f"note: energy drift was not tested: {health.energy_note}"
    if health.clamp is not None:
        yield f"warning: samples above {health.clamp:g} were clamped: affected texels are too dark"
    yield f"median relative standard error {health.relative_error:.2g}, largest radiance {health.largest:.4g}"
    if health.near_singularity is not None:
        yield f"near the singularity of a source: {100 * health.near_singularity:.2g} % of a novel view's texels"


def _capture(capture: CaptureHealth) -> Iterator[str]:
    for one in capture.judgement.suspects:
        yield f"warning: view {one.view} ({printable(one.name)}) {one.what}"
    if capture.judgement.note:
        yield f"note: {capture.judgement.note}"
    yield from (f"note: {printable(one)}" for one in capture.notes)
    yield f"captured: {capture.seen:.0%} of the texels were seen; variance by {capture.variance}"


def _finding(finding: Finding) -> Iterator[str]:
    yield f"{finding.verdict}: {finding}"
    for place in finding.places[:NAMED]:
        yield f"  {_place(place)}"
    if finding.texels > NAMED:
        yield f"  and {finding.texels - NAMED} more"


def _place(place: Place) -> str:
    directions = (f"({x:+.2f}, {y:+.2f}, {z:+.2f})" for x, y, z in (place.normal, place.reflection))
    normal, reflection = directions
    value = "" if place.value is None else f": {place.value:.3g}"
    return (
        f"view {place.view}, row {place.row}, column {place.column} (s {place.s:.4f}, t {place.t:.4f}), "
        f"normal {normal}, mirror direction {reflection}{value}"
    )
