"""`rsibr capture maps`: photographs of a painted sphere with poses become a bake."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rsibr import backend
from rsibr.capture.curves.curve import Curve
from rsibr.capture.maps.document import CaptureDocument, named_photographs, read_document
from rsibr.capture.maps.posed import posed, radiance_of
from rsibr.capture.maps.rectified import Rectification, rectified
from rsibr.capture.maps.stored import coverage_notes, require_resolution, stored
from rsibr.errors import InputError
from rsibr.geometry.partial_views import GAP_DEG
from rsibr.geometry.viewpoints import Viewpoints, partial_views
from rsibr.store.bake import Bake
from rsibr.store.manifest import CaptureRecord
from rsibr.store.map_file import MapFile

_FEW_PIXELS = 1.0
"""Pixels a texel below which the photographs are coarser than the maps."""


@dataclass(frozen=True, eq=False)
class _Made:
    """Map of a photograph, and what is said of it."""

    map: MapFile
    name: str
    distance: float
    saturated: int
    by_spread: bool
    pixels: float
    note: str
    seconds: float


@backend.in_session
def capture_maps(
    document: Path | str,
    out: Path | str,
    *,
    resolution: int = 128,
    rectify: Rectification = "reflection",
    curve: str | Path | Curve = "srgb",
    align: bool = False,
    gap_deg: float = GAP_DEG,
    light: Path | str | None = None,
    fresh: bool = False,
) -> Bake:
    """Make a bake of photographs of a painted sphere.

    Parameters
    ----------
    document : path
        `capture.json`: photographs, cameras, and where the sphere is; see docs/how-to/capture-maps.md.
    out : path
        `NAME.rsibr`.
    resolution : int
        Texels a side of a map.
    rectify : {"reflection", "normal"}
        What map and photograph have in common in a texel: the mirror direction, for glossy paint, or the normal, for
        matte paint.
    curve : str, path or Curve
        Of photographs that are not linear.
    align : bool
        Whether the shots of a view are shifted onto each other.
    gap_deg : float
        Largest circumradius of three views that count as neighbours [degrees].
    light : path, optional
        Environment that lit the sphere, for methods that need it.
    fresh : bool
        Whether a bake of other photographs is replaced.

    Returns
    -------
    Bake
        Without material and, by default, without light: methods that read maps alone serve it.

    Raises
    ------
    InputError
        If a photograph cannot be used, or an option is out of range.
    BakeError, MachineError
        If it cannot be written.

    Examples
    --------
    >>> bake = rsibr.capture_maps("shots/capture.json", "paint.rsibr")       # doctest: +SKIP
    >>> rsibr.reconstruct(bake, view=(1, 2, 3), method="cabral1999")          # doctest: +SKIP
    """
    require_resolution(resolution)
    path = Path(document)
    said = read_document(path)
    made = _maps(said, path, resolution, rectify, curve, align)
    viewpoints = _viewpoints(made, path, gap_deg)
    capture = _record(made, viewpoints, rectify, gap_deg, resolution)
    place = None if light is None else Path(light)
    took = [one.seconds for one in made]
    return stored(Path(out), viewpoints, [one.map for one in made], capture, light=place, fresh=fresh, seconds=took)


def _maps(
    said: CaptureDocument, path: Path, resolution: int, by: Rectification, curve: str | Path | Curve, align: bool
) -> list[_Made]:
    made = []
    for photograph in named_photographs(said, path):
        start = time.perf_counter()
        image = radiance_of(photograph.said, path.parent, curve, said.gain, align=align, where=photograph.name)
        ball, note = posed(photograph, image, said.sphere, path.parent)
        found = rectified(ball, resolution, by)
        pixels = 2 * ball.radius_pixels / resolution
        facts = (photograph.name, ball.distance, found.saturated, found.by_spread, pixels, note)
        made.append(_Made(found.map, *facts, time.perf_counter() - start))
    return made


def _viewpoints(made: list[_Made], path: Path, gap_deg: float) -> Viewpoints:
    try:
        return partial_views([one.map.view for one in made], gap_deg=gap_deg)
    except InputError as error:
        raise InputError(error.what, where=str(path), fix="leave out photographs of the same direction") from None


def _record(
    made: list[_Made], viewpoints: Viewpoints, by: Rectification, gap_deg: float, resolution: int
) -> CaptureRecord:
    notes = [*coverage_notes(viewpoints), *(one.note for one in made if one.note)]
    coarse = min(one.pixels for one in made)
    if coarse < _FEW_PIXELS:
        notes.append(
            f"the sphere is {coarse * resolution:.0f} pixels wide in a photograph: fewer than {resolution} texels"
        )
    saturated = sum(one.saturated for one in made)
    if saturated:
        notes.append(f"{saturated} texels hold saturated pixels: their radiance is a lower bound")
    return CaptureRecord(
        source="photographs",
        names=tuple(one.name for one in made),
        distances=tuple(one.distance for one in made),
        rectified=by,
        variance="spread" if any(one.by_spread for one in made) else "photographs",
        seen=tuple(seen_share(one.map) for one in made),
        saturated=tuple(one.saturated for one in made),
        gap_deg=gap_deg,
        is_partial=viewpoints.is_partial,
        notes=tuple(notes),
    )


def seen_share(map_file: MapFile) -> float:
    """Share of the disk that is covered."""
    return float(min(map_file.coverage.sum(dtype=np.float64) / (np.pi / 4 * map_file.resolution**2), 1.0))
