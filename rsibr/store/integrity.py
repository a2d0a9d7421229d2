"""Integrity of the files of a bake: each is the regular file inside it that the manifest describes."""

from __future__ import annotations

import os
from pathlib import Path

from rsibr.errors import BakeError, RsibrError
from rsibr.regular_file import open_regular
from rsibr.store.atomic import file_checksum, read_bytes, unreadable
from rsibr.store.directory import BAKE_AGAIN
from rsibr.store.light_file import decode_light
from rsibr.store.manifest import LightRecord, Manifest, ViewState
from rsibr.store.map_header import check_header, read_header


def check_file(bake: Path, state: ViewState | LightRecord) -> None:
    """Check that a file of a bake exists with the size and checksum recorded in the manifest.

    Raises
    ------
    BakeError
        If it is missing, is no regular file inside the bake (a shared light: or beside it), cannot be read, or is
        truncated or altered.
    """
    file, is_shared = bake / state.file, isinstance(state, LightRecord) and state.is_shared
    try:
        if not is_shared and Path(os.path.realpath(file)) != Path(os.path.realpath(bake), state.file):
            raise BakeError("is a link; the files of a bake lie in its directory", where=str(file))
        with open_regular(file) as opened:
            size = os.fstat(opened.fileno()).st_size
    except FileNotFoundError as error:
        fix = f"put its folder back, or {BAKE_AGAIN}" if is_shared else BAKE_AGAIN
        what = f"is missing: the light of {bake.name}, shared by the bakes of one sky" if is_shared else "is missing"
        raise BakeError(what, where=str(file), fix=fix) from error
    except OSError as error:
        raise unreadable(file, error) from error
    if size != state.bytes or file_checksum(file) != state.sha256:
        raise altered(file)


def check_map(bake: Path, manifest: Manifest, index: int) -> None:
    """Check the file of the view `index`, and hold its header against the manifest.

    Raises
    ------
    BakeError
        As `check_file`, or if it is the map of another view.
    """
    state = manifest.views[index]
    check_file(bake, state)
    file = bake / state.file
    with open_regular(file) as opened:
        header = read_header(opened, where=str(file))
    check_header(header, manifest, index, where=str(file))


def is_sound_map(bake: Path, manifest: Manifest, index: int) -> bool:
    """Whether `check_map` accepts the file of a view."""
    try:
        check_map(bake, manifest, index)
    except RsibrError:
        return False
    return True


def is_sound_light(bake: Path, light: LightRecord) -> bool:
    """Whether the environment of a bake is as recorded, and can be decoded."""
    file = bake / light.file
    try:
        check_file(bake, light)
        decode_light(read_bytes(file), where=str(file))
    except RsibrError:
        return False
    return True


def altered(file: Path) -> BakeError:
    """Return the error for a `file` that is not as the bake wrote it."""
    fix = "run the same `rsibr bake` command again to make it anew"
    return BakeError("is truncated or altered: it is not the file that the bake wrote", where=str(file), fix=fix)
