"""Packing of a bake: its light, shared with other bakes of its sky, becomes a file of its own."""

from __future__ import annotations

from pathlib import Path

from rsibr.errors import BakeError
from rsibr.store.atomic import read_bytes, write_atomic
from rsibr.store.bake import Bake, open_bake
from rsibr.store.directory import claim_directory, entries, lock_directory, make_own_folder
from rsibr.store.manifest import LIGHT_NAME, MANIFEST_NAME, MAPS_NAME, Manifest, write_manifest


def pack(bake: Bake | Path | str, *, out: Path | str | None = None) -> Bake:
    """Make a bake self-contained: nothing in it refers to a file outside its directory.

    Parameters
    ----------
    bake : Bake or path
        A bake, which may share the file of its environment with others (`lights/` beside it).
    out : path, optional
        Directory of a self-contained copy, empty or absent. By default the bake itself is packed, in its place.

    Returns
    -------
    Bake
        The packed bake. One that is self-contained already is returned as it is, or copied.

    Raises
    ------
    BakeError
        If the bake is not whole, its light is missing or altered, another process is writing it, or `out` holds
        anything.
    MachineError
        If the disk is full.

    Examples
    --------
    >>> bake = rsibr.pack("out/batch/solid-red/city.rsibr", out="city.rsibr")     # doctest: +SKIP
    """
    opened = open_bake(bake.path if isinstance(bake, Bake) else Path(bake))
    if out is not None:
        return _copied(opened, Path(out))
    if opened.manifest.light is None or not opened.manifest.light.is_shared:
        return opened
    lock = lock_directory(opened.path)
    try:
        _write_own(opened, opened.path)
    finally:
        lock.release()
    return open_bake(opened.path)


def _copied(bake: Bake, out: Path) -> Bake:
    claim_directory(out)
    lock = lock_directory(out)
    try:
        if (out / MANIFEST_NAME).exists() or any(entries(out / MAPS_NAME)):
            raise BakeError("holds a bake", where=str(out), fix="choose another --out")
        make_own_folder(out / MAPS_NAME)
        for state in bake.manifest.views:
            write_atomic(out / state.file, read_bytes(bake.path / state.file))
        _write_own(bake, out)
    finally:
        lock.release()
    return open_bake(out)


def _write_own(bake: Bake, out: Path) -> None:
    """Write light and manifest into `out`, the manifest last."""
    light = bake.manifest.light
    if light is not None:
        write_atomic(out / LIGHT_NAME, read_bytes(bake.path / light.file))
    write_manifest(out / MANIFEST_NAME, _self_contained(bake.manifest))


def _self_contained(manifest: Manifest) -> Manifest:
    if manifest.light is None:
        return manifest
    return manifest.model_copy(update={"light": manifest.light.model_copy(update={"file": LIGHT_NAME})})
