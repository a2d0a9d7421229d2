"""Manifest of a capture: maps that rsibr did not render, without a config, and its consistency with itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rsibr import backend
from rsibr.geometry.viewpoints import Viewpoints, partial_views
from rsibr.store.atomic import checksum
from rsibr.store.manifest import CaptureRecord, EnvironmentRecord, Manifest, MaterialRecord, canonical
from rsibr.store.map_file import MapFile, map_digest

MATERIAL = "captured"
UNKNOWN_LIGHT = "unknown light"

_SAME_DIRECTION = 1e-9
_WARPS = {"reflection": "mirror", "normal": "normal"}


@backend.in_session
def captured_manifest(
    viewpoints: Viewpoints,
    maps: Sequence[MapFile],
    capture: CaptureRecord,
    packages: dict[str, str],
    light: tuple[str, str] | None = None,
) -> Manifest:
    """Manifest of a capture without finished views.

    Parameters
    ----------
    viewpoints : Viewpoints
        Directions of the maps, in order.
    maps : sequence of MapFile
        One for each.
    capture : CaptureRecord
        Where they come from.
    packages : dict of str to str
        Versions.
    light : (str, str), optional
        Name and digest of the environment, where it is known.
    """
    content = checksum(canonical([map_digest(one) for one in maps]))
    name, digest = light or (UNKNOWN_LIGHT, content)
    identity: dict[str, Any] = {
        "environment": {"name": name, "content": digest},
        "material": {"name": MATERIAL, "content": content},
    }
    return Manifest.planned(
        config={},
        identity=identity,
        packages=packages,
        variant=backend.use(),
        environment=EnvironmentRecord(name=name),
        material=MaterialRecord(name=MATERIAL, warp="mirror" if capture.rectified == "reflection" else "normal"),
        resolution=maps[0].resolution,
        directions=viewpoints.directions,
        triangles=viewpoints.triangles,
        capture=capture,
    )


def check_capture(manifest: Manifest) -> None:
    """Check that the parts of a capture's manifest fit together.

    Raises
    ------
    ValueError, InputError
        With the first part that does not fit.
    """
    capture, directions = manifest.capture, np.array(manifest.directions, np.float64)
    assert capture is not None
    parts = (manifest.lobes, manifest.plan, manifest.sampling, manifest.budget, manifest.config)
    _require(not any(parts), "capture: a capture has no config, plan, lobes, sampling or budget")
    unit = np.abs(np.linalg.norm(directions, axis=1) - 1) < _SAME_DIRECTION
    _require(bool(unit.all()), f"directions.{np.argmin(unit)}: is no unit vector")
    for name in ("names", "distances", "seen", "saturated"):
        _require(len(getattr(capture, name)) == len(directions), f"capture.{name}: not one for each view")
    found = partial_views(directions, manifest.triangles, gap_deg=capture.gap_deg)
    _require(found.is_partial == capture.is_partial, "capture.is_partial: is not what the triangles say")
    _require(manifest.material.warp == _WARPS[capture.rectified], "material.warp: does not fit capture.rectified")
    _require(manifest.variant.endswith("_rgb"), "variant: does not hold radiance in red, green and blue")
    for kind in ("environment", "material"):
        part = manifest.identity.get(kind)
        known = isinstance(part, dict) and isinstance(part.get("content"), str)
        _require(known, f"identity.{kind}.content: is missing")


def _require(condition: bool, what: str) -> None:
    if not condition:
        raise ValueError(what)
