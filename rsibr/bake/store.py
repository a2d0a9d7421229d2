"""A bake on disk: a directory that one process writes, view by view, and that any process opens once it is whole."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray

from rsibr.bake.atomic import checksum, is_leftover, read_bytes, unreadable, unwritable
from rsibr.bake.directory import (
    BAKE_AGAIN,
    altered,
    check_file,
    claim_directory,
    entries,
    is_whole,
    lock_directory,
    make_folder,
)
from rsibr.bake.manifest import MANIFEST_NAME, MAPS_NAME, Manifest, ViewState, read_manifest, write_manifest
from rsibr.bake.map_file import MapFile, decode_map, write_map
from rsibr.errors import BakeError

_MAP_PATTERN = re.compile(r"view_\d{4,}\.exr")
_NAME_A_BAKE = "name a directory that `rsibr bake` made"
_VIEW_TOLERANCE = 1e-6  # a map's header keeps its view in float32


class BakeWriter:
    """The one process that may write a bake; made by `BakeWriter.open`, used in a `with` statement.

    A crash at any moment leaves a bake that the next writer goes on with. Views that are done stay done.

    Attributes
    ----------
    path : Path
        Directory of the bake.
    manifest : Manifest
        As it stands on disk.
    """

    def __init__(self, path: Path, manifest: Manifest, lock: FileLock) -> None:
        self.path = path
        self.manifest = manifest
        self._lock = lock

    @classmethod
    def open(cls, path: Path, manifest: Manifest, fresh: bool = False) -> BakeWriter:
        """Begin a bake in the directory `path`, or go on with the one that is there.

        Parameters
        ----------
        path : Path
            Directory of the bake, `NAME.rsibr`; made where it does not exist, parents too.
        manifest : Manifest
            What to bake, from `Manifest.planned`.
        fresh : bool
            Whether to throw away a bake that is there, whatever its config and state, and to begin anew.

        Returns
        -------
        BakeWriter
            Holds the directory's lock until it is closed.

        Raises
        ------
        BakeError
            If the directory holds something else than a bake; a bake of another config or a broken manifest, unless
            `fresh`; or if another process is writing it, or it may not be written to.
        MachineError
            If the disk is full or fails.
        """
        path = Path(path)
        claim_directory(path)
        lock = lock_directory(path)
        try:
            make_folder(path / MAPS_NAME)
            writer = cls(path, _continued(path, manifest, fresh), lock)
            writer._record(writer.manifest)
            writer._sweep()
        except BaseException:
            lock.release()
            raise
        return writer

    @property
    def pending(self) -> list[int]:
        """Indices of the views that are still to bake, ascending."""
        return self.manifest.pending

    def commit(self, index: int, map_file: MapFile, seconds: float) -> None:
        """Store the map of one view, for good: once this returns, not even a power cut takes it back.

        Parameters
        ----------
        index : int
            A pending view.
        map_file : MapFile
            Its map, with its variance, at the bake's resolution and seen from the view's direction.
        seconds : float
            Time that the view took to bake [s].

        Raises
        ------
        ValueError
            If the view is not pending, or the map is not of this view.
        MachineError, BakeError
            If the map cannot be written; the view is pending still.
        """
        if index not in self.pending:
            raise ValueError(f"view {index} is not pending")
        state = self.manifest.views[index]
        _check_map(map_file, state, self.manifest.resolution)
        if not (math.isfinite(seconds) and seconds >= 0.0):
            raise ValueError(f"a view cannot take {seconds} s")
        file = self.path / state.file
        sha256 = write_map(file, map_file)
        done = state.finished(sha256=sha256, seconds=float(seconds), size=file.stat().st_size)
        self._record(self.manifest.with_views(done))

    def close(self) -> None:
        """Give the directory free for another writer."""
        self._lock.release()

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close the writer, whether or not the work succeeded."""
        self.close()

    def _record(self, manifest: Manifest) -> None:
        write_manifest(self.path / MANIFEST_NAME, manifest)
        self.manifest = manifest

    def _sweep(self) -> None:
        """Remove what killed writers left behind: temporary files, and maps that the manifest does not count."""
        done = {self.path / state.file for state in self.manifest.views if state.done}
        stale = [entry for entry in entries(self.path) if is_leftover(entry)]
        for entry in entries(self.path / MAPS_NAME):
            if is_leftover(entry) or (_MAP_PATTERN.fullmatch(entry.name) and entry not in done):
                stale.append(entry)
        for entry in stale:
            try:
                entry.unlink()
            except OSError as error:
                raise unwritable(entry, error) from error


@dataclass(frozen=True, eq=False)
class Bake:
    """A whole bake, as `open_bake` found it: maps are read when they are asked for.

    Attributes
    ----------
    path : Path
        Its directory.
    manifest : Manifest
        What it was made from, and with what.
    """

    path: Path
    manifest: Manifest

    @property
    def view_count(self) -> int:
        """Number of stored views."""
        return len(self.manifest.views)

    @property
    def complete(self) -> bool:
        """Whether all views are done; true of every bake that `open_bake` returns."""
        return not self.manifest.pending

    @property
    def resolution(self) -> int:
        """Texels along each side of a map."""
        return self.manifest.resolution

    @property
    def config(self) -> dict[str, Any]:
        """The configuration that it was baked from, as JSON holds it."""
        return self.manifest.config

    @property
    def seconds(self) -> float:
        """Time that all views together took to bake [s]."""
        return self.manifest.seconds

    @property
    def bytes(self) -> int:
        """Size of all maps together [bytes]."""
        return self.manifest.size

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """Unit view vectors, shape (V, 3), in the order of the maps; read-only."""
        directions = np.array(self.manifest.directions, np.float64)
        directions.setflags(write=False)
        return directions

    @cached_property
    def triangles(self) -> NDArray[np.int64]:
        """Triangulation of the directions, shape (M, 3), indices into them; read-only."""
        triangles = np.array(self.manifest.triangles, np.int64).reshape(-1, 3)
        triangles.setflags(write=False)
        return triangles

    def map(self, index: int) -> MapFile:
        """Read the map of one view.

        Its `view` and `frame` have the header's float32 precision; `directions[index]` is exact.

        Raises
        ------
        IndexError
            If there is no such view.
        BakeError
            If the file was altered since the bake was opened.
        """
        if not 0 <= index < self.view_count:
            raise IndexError(f"view {index} of {self.view_count}")
        state = self.manifest.views[index]
        file = self.path / state.file
        data = read_bytes(file)
        if checksum(data) != state.sha256:
            raise altered(file)
        return decode_map(data, where=str(file))


def open_bake(path: Path) -> Bake:
    """Open a bake and check all of it: schema, manifest, and size and checksum of every map.

    Parameters
    ----------
    path : Path
        Directory of the bake, `NAME.rsibr`.

    Raises
    ------
    BakeError
        If there is no bake, it is not finished, or anything in it is missing, truncated or altered.
    """
    path = Path(path)
    _check_kind(path)
    manifest = read_manifest(path / MANIFEST_NAME)
    if manifest.pending:
        total = len(manifest.views)
        done = total - len(manifest.pending)
        raise BakeError(f"is not finished: it holds {done} of {total} views", where=str(path), fix=BAKE_AGAIN)
    for state in manifest.views:
        check_file(path / state.file, state)
    return Bake(path, manifest)


def _check_kind(path: Path) -> None:
    try:
        if not path.exists():
            raise BakeError("does not exist", where=str(path), fix="make it with `rsibr bake`")
        if not path.is_dir():
            raise BakeError("is a file; a bake is a directory", where=str(path), fix=_NAME_A_BAKE)
        if not (path / MANIFEST_NAME).exists():
            raise BakeError("is a directory without a manifest, so no bake", where=str(path), fix=_NAME_A_BAKE)
    except OSError as error:
        raise unreadable(path, error) from error


def _continued(path: Path, wanted: Manifest, fresh: bool) -> Manifest:
    """Return `wanted` with the views that are already there, whole."""
    if fresh or not (path / MANIFEST_NAME).exists():
        return wanted
    found = read_manifest(path / MANIFEST_NAME)
    differences = found.differences(wanted)
    if differences:
        what = f"holds a bake of another config ({'; '.join(differences)})"
        raise BakeError(what, where=str(path), fix="use --fresh to bake anew, or another --out")
    return wanted.with_views(*(state for state in found.views if state.done and is_whole(path / state.file, state)))


def _check_map(map_file: MapFile, state: ViewState, resolution: int) -> None:
    if map_file.resolution != resolution:
        raise ValueError(f"the map has {map_file.resolution} texels a side, the bake {resolution}")
    if not np.allclose(map_file.view, state.view, rtol=0.0, atol=_VIEW_TOLERANCE):
        raise ValueError(f"the map is seen from {map_file.view}, view {state.index} from {state.view}")
    if map_file.variance is None:
        raise ValueError("a baked map comes with its variance")
