"""Maps of a capture as a bake on disk."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from rsibr import backend
from rsibr.baking.finished import package_versions
from rsibr.errors import InputError
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.light.radiance import light_of
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from rsibr.store.bake import Bake, BakeWriter, open_bake
from rsibr.store.capture import captured_manifest
from rsibr.store.manifest import MAX_RESOLUTION, CaptureRecord
from rsibr.store.map_file import MapFile

LEAST_RESOLUTION = 8


@backend.in_session
def stored(
    out: Path,
    viewpoints: Viewpoints,
    maps: Sequence[MapFile],
    capture: CaptureRecord,
    *,
    light: Path | None = None,
    fresh: bool = False,
    seconds: Sequence[float] | None = None,
) -> Bake:
    """Write the bake and open it.

    Parameters
    ----------
    out : Path
        `NAME.rsibr`.
    viewpoints : Viewpoints
        Directions of the maps, in order.
    maps : sequence of MapFile
        With variance.
    capture : CaptureRecord
        Where they come from.
    light : Path, optional
        Environment that lit them.
    fresh : bool
        Whether a bake of other maps is replaced.
    seconds : sequence of float, optional
        Time that each map took [s].
    """
    environment = None if light is None else load_environment(EnvironmentConfig(file=light.resolve()))
    known = None if environment is None else (environment.name, environment.digest)
    manifest = captured_manifest(viewpoints, maps, capture, package_versions(), known)
    took = seconds or [0.0] * len(maps)
    with BakeWriter.open(out, manifest, fresh) as writer:
        for index in writer.pending:
            writer.commit(index, maps[index], took[index])
        if environment is not None and not writer.has_light:
            writer.commit_light(light_of(environment, with_image=True))
    return open_bake(out)


def require_resolution(resolution: int) -> None:
    """Raise an InputError if no map has so many texels a side."""
    if not LEAST_RESOLUTION <= resolution <= MAX_RESOLUTION:
        raise InputError(f"{resolution} texels", where="resolution", fix=f"give {LEAST_RESOLUTION} to {MAX_RESOLUTION}")


def coverage_notes(viewpoints: Viewpoints) -> list[str]:
    """What the views do not cover, in words."""
    largest = math.degrees(viewpoints.largest_circumradius)
    if not viewpoints.is_partial:
        return [f"the views surround the sphere; the largest circumradius of their triangles is {largest:.1f}°"]
    if not len(viewpoints.triangles):
        return ["no three views are neighbours: they cover arcs between them and nothing else; other views are flagged"]
    covered = (
        f"the views cover {viewpoints.covered:.0%} of the sphere, with triangles up to {largest:.1f}° of circumradius"
    )
    return [f"{covered}; beyond, the nearest stored views answer, and the result is flagged"]
