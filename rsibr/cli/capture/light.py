"""`rsibr capture light`: lamps added to an environment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rsibr.cli.capture.options import OutExr, check_output_exr, numbers
from rsibr.cli.capture.report import report
from rsibr.cli.options import Json


def light(
    environment: Annotated[Path, typer.Argument(metavar="SKY", help="OpenEXR or Radiance map.", show_default=False)],
    out: OutExr,
    point: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,Z,R,G,B", help="Lamp at a place seen from the object, with its intensity [W/sr]."),
    ] = None,
    directional: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,Z,R,G,B", help="Lamp in a direction, with its irradiance [W/m²]."),
    ] = None,
    disc: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y,Z,DEG,R,G,B", help="Disc in a direction, its half angle, its irradiance [W/m²]."),
    ] = None,
    object_radius: Annotated[float, typer.Option(help="Radius of the object, in the unit of --point.")] = 1.0,
    json_output: Json = False,
) -> None:
    """Add lamps to an environment, with their energy and direction."""
    check_output_exr(out)
    places = [numbers(one, 6, "--point") for one in point or ()]
    toward = [numbers(one, 6, "--directional") for one in directional or ()]
    discs = [numbers(one, 7, "--disc") for one in disc or ()]
    from rsibr.capture.added_lamps import capture_light, lamp_notes
    from rsibr.capture.lamps.lamp import Lamp, point_lamp

    lamps = [point_lamp((x, y, z), (r, g, b)) for x, y, z, r, g, b in places]
    lamps += [Lamp((x, y, z), (r, g, b)) for x, y, z, r, g, b in toward]
    lamps += [Lamp((x, y, z), (r, g, b), angle) for x, y, z, angle, r, g, b in discs]
    near = lamp_notes([one[:3] for one in places], object_radius)
    found = capture_light(environment, lamps)
    found.write(out)
    rows, columns = found.radiance.shape[:2]
    facts = {
        "width": columns,
        "height": rows,
        "source": found.source,
        "lamps": [{"direction": one.toward.tolist(), "irradiance": list(one.irradiance)} for one in lamps],
    }
    report(out, f"{columns} × {rows} texels, {found.source}", facts, (*found.notes, *near), json_output=json_output)
