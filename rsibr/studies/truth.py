"""References on disk, rendered once."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.store.atomic import checksum, file_checksum, read_bytes, write_atomic
from rsibr.store.directory import make_own_folder
from rsibr.studies.journal import Journal, name_of
from rsibr.studies.scene import StudyScene
from rsibr.validation.reference import MINIMUM_BUFFERS, Reference

Arrays = dict[str, NDArray[Any]]


class TruthStore:
    """Store of references and lobe references on disk.

    Parameters
    ----------
    folder : Path
        Where the arrays lie; made where missing.
    journal : Journal
        Where it is noted, with a checksum, that they are whole.
    """

    def __init__(self, folder: Path, journal: Journal) -> None:
        self._folder, self._journal = folder, journal
        make_own_folder(folder)

    def has(self, key: Mapping[str, Any]) -> bool:
        """Whether the arrays of `key` are on disk and undamaged."""
        note = self._journal.find(key)
        path = self._path(key)
        return note is not None and path.is_file() and file_checksum(path) == note["sha256"]

    def get(self, key: Mapping[str, Any], make: Callable[[], tuple[Arrays, dict[str, Any]]]) -> tuple[Arrays, Any]:
        """Return the arrays of `key` and their facts; make and store them where missing or damaged."""
        if not self.has(key):
            arrays, facts = make()
            data = _packed(arrays)
            write_atomic(self._path(key), data)
            self._journal.store(key, {"sha256": checksum(data), "facts": facts})
        return _unpacked(read_bytes(self._path(key))), self._journal.find(key)["facts"]

    def _path(self, key: Mapping[str, Any]) -> Path:
        return self._folder / f"{name_of(key)}.npz"


def reference_key(scene: StudyScene, frame: NDArray[np.float64], samples: int) -> dict[str, Any]:
    """Key of a reference: everything that it depends on."""
    return {"kind": "reference", **scene.identity, "frame": frame.tolist(), "samples": samples}


def reference_of(scene: StudyScene, frame: NDArray[np.float64], samples: int, store: TruthStore) -> Reference:
    """Path-traced reference of a view, from disk if it is there."""

    def make() -> tuple[Arrays, dict[str, Any]]:
        made = scene.tracer.render(frame, samples, seed=scene.seed, buffers=MINIMUM_BUFFERS)
        facts = {"samples": made.samples, "seconds": made.seconds, "sampler": made.sampler}
        return {"buffers": made.buffers, "coverage": made.coverage}, facts

    arrays, facts = store.get(reference_key(scene, frame, samples), make)
    return Reference(
        arrays["buffers"], arrays["coverage"], facts["samples"], facts["seconds"], sampler=facts["sampler"]
    )


def _packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def _unpacked(data: bytes) -> Arrays:
    with zipfile.ZipFile(io.BytesIO(data)) as names, np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return {name.removesuffix(".npy"): arrays[name.removesuffix(".npy")] for name in names.namelist()}
