"""Sidecar of a map: state of one view in a file of its own, written after the map and before the manifest.

Whoever bakes a view, in whatever process, writes its map and then `maps/view_NNNN.json`. A map with a sidecar is whole
even if the manifest does not list it yet; the next writer of the bake adopts it. Sidecars vanish once the manifest
lists their views.
"""

from __future__ import annotations

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, ValidationError

from rsibr.errors import RsibrError
from rsibr.store.atomic import checksum, read_bytes, write_atomic
from rsibr.store.health import map_health
from rsibr.store.integrity import is_sound_map
from rsibr.store.manifest import Manifest, Record, ViewState, sealed
from rsibr.store.map_file import MapFile, encode_map
from rsibr.store.noise import map_noise

LARGEST_SIDECAR = 2**16
"""Largest size of a sidecar that is read [bytes]; one has some 700 bytes."""

_ATTEMPTS = 3
_VIEW_TOLERANCE = 1e-6  # the header of a map stores its view in float32


class Sidecar(Record):
    """State of a finished view.

    Attributes
    ----------
    schema_version : int
        Version of this schema.
    bits : str
        Digest of everything that determines the bits of the bake's maps; see `rsibr.store.difference.bits_digest`.
    state : ViewState
        State of the view, as the manifest will list it.
    """

    schema_version: Literal[1] = 1
    bits: str = Field(pattern=r"^[0-9a-f]{64}$")
    state: ViewState


def sidecar_file(bake: Path, state: ViewState) -> Path:
    """Path of the sidecar of a view."""
    return (bake / state.file).with_suffix(".json")


def store_view(bake: Path, manifest: Manifest, bits: str, index: int, map_file: MapFile, seconds: float) -> ViewState:
    """Write the map of a view, and then its sidecar; both survive a power failure once this returns.

    Needs no lock: processes that store the same view write the same map, and the last sidecar counts.

    Parameters
    ----------
    bake : Path
        Directory of the bake, with its folder of maps.
    manifest : Manifest
        Manifest of the bake; what it says of finished views is not read.
    bits : str
        `bits_digest` of the manifest.
    index : int
        View.
    map_file : MapFile
        Its map with its variance, at the resolution of the bake.
    seconds : float
        Render time of the view [s].

    Returns
    -------
    ViewState
        State of the view, for the manifest.

    Raises
    ------
    ValueError
        If the map is not of this view.
    MachineError, BakeError
        If a file cannot be written; the view then remains pending.
    """
    state = manifest.views[index]
    _check_map(map_file, state, manifest.resolution)
    if not (math.isfinite(seconds) and seconds >= 0.0):
        raise ValueError(f"a view cannot take {seconds} s")
    file, data, noise = bake / state.file, encode_map(map_file), map_noise(map_file)
    done = state.finished(
        checksum(data),
        float(seconds),
        len(data),
        map_health(map_file, captured=manifest.capture is not None).record(),
        noise if math.isfinite(noise) else None,
    )
    content = sealed(Sidecar(bits=bits, state=done).model_dump(mode="json"))
    for _ in range(_ATTEMPTS):  # a writer that began meanwhile may have swept the map before it had its sidecar
        write_atomic(file, data)
        write_atomic(sidecar_file(bake, state), content)
        if file.exists():
            break
    return done


def adopted(bake: Path, manifest: Manifest, bits: str, index: int) -> ViewState | None:
    """State of a view from its sidecar.

    Parameters
    ----------
    bake : Path
        Directory of the bake.
    manifest : Manifest
        Manifest of the bake.
    bits : str
        `bits_digest` of the manifest.
    index : int
        View.

    Returns
    -------
    ViewState or None
        None without a whole sidecar of this bake, or if its map is missing, altered, or that of another view.
    """
    state = manifest.views[index]
    with suppress(RsibrError, ValidationError, ValueError, LookupError, TypeError, RecursionError):
        data = read_bytes(sidecar_file(bake, state), most=LARGEST_SIDECAR)
        body = json.loads(data)
        del body["checksum"]
        if data != sealed(body):
            return None
        found = Sidecar.model_validate_json(json.dumps(body), strict=True)
        same = (found.state.index, found.state.view, found.state.done) == (index, state.view, True)
        if found.bits == bits and same and is_sound_map(bake, manifest.with_views(found.state), index):
            return found.state
    return None


def _check_map(map_file: MapFile, state: ViewState, resolution: int) -> None:
    if map_file.resolution != resolution:
        raise ValueError(f"the map has {map_file.resolution} texels a side, the bake {resolution}")
    if not np.allclose(map_file.view, state.view, rtol=0.0, atol=_VIEW_TOLERANCE):
        raise ValueError(f"the map is seen from {map_file.view}, view {state.index} from {state.view}")
    if map_file.variance is None:
        raise ValueError("a baked map comes with its variance")
