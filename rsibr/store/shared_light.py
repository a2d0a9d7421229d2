"""Light of a sky that several bakes share: `lights/SHA256.exr` beside them, named by its content."""

from __future__ import annotations

import os
from pathlib import Path
from weakref import WeakKeyDictionary

from rsibr.errors import InputError
from rsibr.light.radiance import Light
from rsibr.store.atomic import checksum, file_checksum, write_atomic
from rsibr.store.directory import make_folder
from rsibr.store.light_file import encode_light
from rsibr.store.manifest import LIGHT_NAME, LIGHTS_NAME, LightRecord

_encoded: WeakKeyDictionary[Light, LightRecord] = WeakKeyDictionary()
"""Records of lights that were stored already, while they live: encoding takes longer than all else about them."""


def store_light(bake: Path, light: Light, lights: Path | None = None) -> LightRecord:
    """Write the environment of a bake durably.

    Parameters
    ----------
    bake : Path
        Directory of the bake.
    light : Light
        Its environment.
    lights : Path, optional
        Folder shared by bakes, named `lights`, beside the bake or above it; created if absent. By default the file is
        written into the bake.

    Returns
    -------
    LightRecord
        For the manifest.

    Raises
    ------
    InputError
        If the folder has another name or place.
    MachineError, BakeError
        If the file cannot be written.

    Notes
    -----
    Processes may store one light at once: equal lights have equal bytes, and each of them replaces the file as a whole.
    """
    if lights is None:
        data = encode_light(light)
        write_atomic(bake / LIGHT_NAME, data)
        return LightRecord(sha256=checksum(data), bytes=len(data), delta_lights=len(light.delta))
    require_shareable(bake, lights)
    known = _encoded.get(light)
    if known is not None and _is_there(lights / f"{known.sha256}.exr", known):
        return known.model_copy(update={"file": _from_bake(bake, lights, known.sha256)})
    data = encode_light(light)
    sha256 = checksum(data)
    file = _from_bake(bake, lights, sha256)
    record = LightRecord(sha256=sha256, bytes=len(data), delta_lights=len(light.delta), file=file)
    make_folder(lights)
    if not _is_there(lights / f"{sha256}.exr", record):
        write_atomic(lights / f"{sha256}.exr", data)
    _encoded[light] = record
    return record


def require_shareable(bake: Path, lights: Path) -> None:
    """Check that a bake may refer to files in the folder `lights`: only up from itself, and by that name.

    Raises
    ------
    InputError
        If it may not.
    """
    place = Path(os.path.relpath(os.path.realpath(lights), os.path.realpath(bake)))
    *up, name = place.parts or ("",)
    if name != LIGHTS_NAME or not up or set(up) != {".."}:
        raise InputError(
            f"{lights} is no folder of lights for {bake}",
            where="lights",
            fix=f"name a folder `{LIGHTS_NAME}` beside the bake, or beside a folder that holds it",
        )


def _from_bake(bake: Path, lights: Path, sha256: str) -> str:
    return Path(os.path.relpath(os.path.realpath(lights), os.path.realpath(bake)), f"{sha256}.exr").as_posix()


def _is_there(file: Path, record: LightRecord) -> bool:
    return file.is_file() and file.stat().st_size == record.bytes and file_checksum(file) == record.sha256
