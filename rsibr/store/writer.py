"""Writing of a bake: one process at a time, view by view, so that a crash loses at most one view."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from filelock import FileLock

from rsibr.errors import BakeError
from rsibr.light.radiance import Light
from rsibr.planning.plan import Plan
from rsibr.store.atomic import checksum, is_leftover, unwritable, write_atomic
from rsibr.store.difference import differences
from rsibr.store.directory import MAP_PATTERN, claim_directory, entries, lock_directory, make_own_folder
from rsibr.store.health import map_health
from rsibr.store.integrity import is_sound_light, is_sound_map
from rsibr.store.light_file import LIGHT_NAME, encode_light
from rsibr.store.manifest import (
    MANIFEST_NAME,
    MAPS_NAME,
    LightRecord,
    Manifest,
    ViewState,
    read_manifest,
    write_manifest,
)
from rsibr.store.map_file import MapFile, write_map
from rsibr.store.noise import map_noise

_VIEW_TOLERANCE = 1e-6  # the header of a map stores its view in float32


class BakeWriter:
    """Exclusive writer of a bake; made by `BakeWriter.open`, used in a `with` statement.

    After a crash at any moment the next writer resumes the bake; finished views are kept.

    Attributes
    ----------
    path : Path
        Directory of the bake.
    manifest : Manifest
        Manifest on disk.
    """

    def __init__(self, path: Path, manifest: Manifest, lock: FileLock) -> None:
        self.path = path
        self.manifest = manifest
        self._lock = lock

    @classmethod
    def open(
        cls, path: Path, manifest: Manifest | Callable[[Manifest | None], Manifest], fresh: bool = False
    ) -> BakeWriter:
        """Begin a bake in the directory `path`, or resume the one that exists there.

        Parameters
        ----------
        path : Path
            Directory of the bake, `NAME.rsibr`; created with its parents if absent.
        manifest : Manifest or callable
            Manifest of the bake, from `Manifest.planned`. Or a function that makes it of the existing manifest, if any,
            once the directory is locked, so that earlier decisions are kept.
        fresh : bool
            Whether to discard an existing bake, whatever its config and state.

        Returns
        -------
        BakeWriter
            Holds the lock of the directory until it is closed.

        Raises
        ------
        BakeError
            If the directory has other content; if it holds a bake of another config or a broken manifest, unless
            `fresh`; if another process is writing it; or if it is not writable.
        MachineError
            If the disk is full or fails.
        """
        path = Path(path)
        claim_directory(path)
        lock = lock_directory(path)
        try:
            make_own_folder(path / MAPS_NAME)
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
        """Store the map of one view durably: it survives a power failure once this returns.

        Parameters
        ----------
        index : int
            A pending view.
        map_file : MapFile
            Map of the view, with its variance, at the resolution of the bake.
        seconds : float
            Render time of the view [s].

        Raises
        ------
        ValueError
            If the view is not pending, or the map is not of this view.
        MachineError, BakeError
            If the map cannot be written; the view remains pending.
        """
        if index not in self.pending:
            raise ValueError(f"view {index} is not pending")
        state = self.manifest.views[index]
        _check_map(map_file, state, self.manifest.resolution)
        if not (math.isfinite(seconds) and seconds >= 0.0):
            raise ValueError(f"a view cannot take {seconds} s")
        file = self.path / state.file
        sha256 = write_map(file, map_file)
        size, health, noise = file.stat().st_size, map_health(map_file).record(), map_noise(map_file)
        done = state.finished(sha256, float(seconds), size, health, noise if math.isfinite(noise) else None)
        self._record(self.manifest.with_views(done))

    @property
    def has_light(self) -> bool:
        """Whether the environment is stored already."""
        return self.manifest.light is not None

    def commit_light(self, light: Light) -> None:
        """Store the environment durably.

        Raises
        ------
        MachineError, BakeError
            If it cannot be written.
        """
        data = encode_light(light)
        write_atomic(self.path / LIGHT_NAME, data)
        record = LightRecord(sha256=checksum(data), bytes=len(data), delta_lights=len(light.delta))
        self._record(self.manifest.model_copy(update={"light": record}))

    def record_end(self, plan: Plan, seconds: float) -> None:
        """Replace the plan in the manifest, now that its costs are known, and add the wall time of this run [s]."""
        whole = self.manifest.wall_seconds + seconds
        self._record(self.manifest.model_copy(update={"plan": plan, "wall_seconds": whole}))

    def close(self) -> None:
        """Release the lock of the directory."""
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
        """Remove remains of killed writers: temporary files, and maps that the manifest does not list as done."""
        done = {self.path / state.file for state in self.manifest.views if state.done}
        stale = [entry for entry in entries(self.path) if is_leftover(entry)]
        for entry in entries(self.path / MAPS_NAME):
            if is_leftover(entry) or (MAP_PATTERN.fullmatch(entry.name) and entry not in done):
                stale.append(entry)
        for entry in stale:
            try:
                entry.unlink()
            except OSError as error:
                raise unwritable(entry, error) from error


def _continued(path: Path, manifest: Manifest | Callable[[Manifest | None], Manifest], fresh: bool) -> Manifest:
    """Return the wanted manifest with the finished views of the existing one whose files are intact."""
    found = None if fresh or not (path / MANIFEST_NAME).exists() else read_manifest(path / MANIFEST_NAME)
    wanted = manifest if isinstance(manifest, Manifest) else manifest(found)
    if found is None:
        return wanted
    differing = differences(found, wanted)
    if differing:
        what = f"holds a bake of another config ({'; '.join(differing)})"
        raise BakeError(what, where=str(path), fix="use --fresh to bake anew, or another --out")
    light = found.light if found.light and is_sound_light(path, found.light) else None
    kept = wanted.model_copy(update={"light": light, "wall_seconds": found.wall_seconds})
    done = [state for state in found.views if state.done]
    known = kept.with_views(*done)  # as planned now, with the checksums that were found
    return kept.with_views(*(state for state in done if is_sound_map(path, known, state.index)))


def _check_map(map_file: MapFile, state: ViewState, resolution: int) -> None:
    if map_file.resolution != resolution:
        raise ValueError(f"the map has {map_file.resolution} texels a side, the bake {resolution}")
    if not np.allclose(map_file.view, state.view, rtol=0.0, atol=_VIEW_TOLERANCE):
        raise ValueError(f"the map is seen from {map_file.view}, view {state.index} from {state.view}")
    if map_file.variance is None:
        raise ValueError("a baked map comes with its variance")
