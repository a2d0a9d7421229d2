"""Writing of a bake: one process at a time owns the manifest, and a crash loses at most one view.

Each view is a map and a sidecar; see `rsibr.store.sidecar`. The manifest, which grows with the number of views, is
written at the beginning, at most `MOST_WRITES` times meanwhile, and at the end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from filelock import FileLock

from rsibr.errors import BakeError, RsibrError
from rsibr.light.radiance import Light
from rsibr.planning.plan import Plan
from rsibr.store.atomic import is_leftover, unwritable
from rsibr.store.difference import bits_digest, differences
from rsibr.store.directory import MAP_PATTERN, claim_directory, entries, lock_directory, make_own_folder
from rsibr.store.integrity import is_sound_light, is_sound_map
from rsibr.store.manifest import MANIFEST_NAME, MAPS_NAME, Manifest, read_manifest, write_manifest
from rsibr.store.map_file import MapFile
from rsibr.store.shared_light import store_light
from rsibr.store.sidecar import adopted, sidecar_file, store_view

MANIFEST_SECONDS = 1.0
"""Least time [s] between two writes of the manifest while views are stored."""

MOST_WRITES = 4
"""Most writes of the manifest while the views of a bake are stored; sidecars hold what it does not list yet."""


class BakeWriter:
    """Exclusive writer of a bake; made by `BakeWriter.open`, used in a `with` statement.

    After a crash at any moment the next writer resumes the bake; finished views are kept.

    Attributes
    ----------
    path : Path
        Directory of the bake.
    manifest : Manifest
        Manifest of the bake; on disk when the writer is closed, and before that with sidecars for what it lacks.
    """

    def __init__(self, path: Path, manifest: Manifest, lock: FileLock) -> None:
        self.path = path
        self.manifest = manifest
        self._lock = lock
        self._bits = bits_digest(manifest)
        self._unlisted = 0  # views that the manifest on disk does not list yet
        self._written = time.monotonic()

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
            if not fresh:
                writer._adopt()
            writer._record(writer.manifest)
            writer._sweep(keeps_stored=not fresh)
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
        done = store_view(self.path, self.manifest, self._bits, index, map_file, seconds)
        self.manifest = self.manifest.with_views(done)
        self._unlisted += 1
        due = time.monotonic() >= self._written + MANIFEST_SECONDS
        if due and MOST_WRITES * self._unlisted >= len(self.manifest.views):
            self._record(self.manifest)

    @property
    def has_light(self) -> bool:
        """Whether the environment is stored already."""
        return self.manifest.light is not None

    def commit_light(self, light: Light, lights: Path | None = None) -> None:
        """Store the environment durably, in the bake or in the folder `lights`; see `store_light`.

        Raises
        ------
        InputError
            If the folder has another name or place.
        MachineError, BakeError
            If it cannot be written.
        """
        self._record(self.manifest.model_copy(update={"light": store_light(self.path, light, lights)}))

    def record_end(self, plan: Plan, seconds: float) -> None:
        """Replace the plan in the manifest, now that its costs are known, and add the wall time of this run [s]."""
        whole = self.manifest.wall_seconds + seconds
        self._record(self.manifest.model_copy(update={"plan": plan, "wall_seconds": whole}))

    def close(self) -> None:
        """Write what the manifest on disk lacks, remove the sidecars that it makes needless, and release the lock."""
        try:
            if self._unlisted:
                self._record(self.manifest)
            _remove(self._needless_sidecars())
        finally:
            self._lock.release()

    def __enter__(self) -> Self:
        """Return the writer itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close the writer, whether or not the work succeeded; an error of the work is not replaced by another."""
        if error is None:
            self.close()
        else:
            with suppress(RsibrError):
                self.close()

    def _record(self, manifest: Manifest) -> None:
        write_manifest(self.path / MANIFEST_NAME, manifest)
        self.manifest, self._unlisted, self._written = manifest, 0, time.monotonic()

    def _adopt(self) -> None:
        """Take over views whose sidecars are whole: of a writer that was killed, or of units in other processes."""
        found = (adopted(self.path, self.manifest, self._bits, index) for index in self.pending)
        self.manifest = self.manifest.with_views(*(state for state in found if state is not None))

    def _sweep(self, keeps_stored: bool) -> None:
        """Remove remains of killed writers: temporary files, and maps and sidecars of views that are not done.

        With `keeps_stored`, views stay that units in other processes have stored since their sidecars were adopted.
        """
        views, bits = self.manifest.views, self._bits
        stored = [k for k in self.pending if keeps_stored and adopted(self.path, self.manifest, bits, k) is not None]
        kept = {self.path / state.file for state in views if state.done or state.index in stored}
        stale = [entry for entry in entries(self.path) if is_leftover(entry)]
        for entry in entries(self.path / MAPS_NAME):
            is_ours = MAP_PATTERN.fullmatch(entry.name) is not None
            if is_leftover(entry) or (is_ours and entry.with_suffix(".exr") not in kept):
                stale.append(entry)
        _remove(stale)
        _remove(self._needless_sidecars())

    def _needless_sidecars(self) -> Iterator[Path]:
        """Sidecars of the views that the manifest lists as done."""
        there = {entry.name for entry in entries(self.path / MAPS_NAME)}
        files = (sidecar_file(self.path, state) for state in self.manifest.views if state.done)
        yield from (file for file in files if file.name in there)


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            raise unwritable(file, error) from error


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
    views = tuple(state.pending() for state in wanted.views)
    kept = wanted.model_copy(update={"light": light, "wall_seconds": found.wall_seconds, "views": views})
    done = [state for state in found.views if state.done]
    known = kept.with_views(*done)  # as planned now, with the checksums that were found
    return kept.with_views(*(state for state in done if is_sound_map(path, known, state.index)))
