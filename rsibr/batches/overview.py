"""Overview of a batch, made from its results: the index and the gallery."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.batches.gallery.entry import GalleryEntry
from rsibr.batches.gallery.gallery import write_gallery
from rsibr.batches.gallery.thumbnail import MOST_PICTURES, thumbnail
from rsibr.batches.index import Index, write_index
from rsibr.batches.result import JobResult, read_results
from rsibr.errors import RsibrError
from rsibr.store.manifest import MAPS_NAME
from rsibr.store.map_file import read_map

FIRST_MAP = "view_0000.exr"
"""Map that the gallery shows: the same view of every bake with the same stored views."""


def write_overview(out: Path, title: str, order: Iterable[str] = ()) -> tuple[Index, Path]:
    """Write the index and the gallery of all results in the directory of a batch.

    Parameters
    ----------
    out : Path
        Directory of the batch.
    title : str
        Name of the batch.
    order : iterable of str
        Names of jobs in the order of the batch; results of other jobs come behind, by name.

    Returns
    -------
    Index
        Written index.
    Path
        Written gallery.

    Raises
    ------
    MachineError, BakeError
        If a file cannot be written.
    """
    damaged: list[Path] = []
    place = {name: number for number, name in enumerate(order)}
    results = sorted(read_results(out, damaged.append), key=lambda one: (place.get(one.name, len(place)), one.name))
    return write_index(out, results, damaged), write_gallery(out, gallery_entries(out, results), title)


def gallery_entries(out: Path, results: Sequence[JobResult]) -> list[GalleryEntry]:
    """Entries of the gallery; only as many have a picture as fit into it."""
    entries, pictures = list[GalleryEntry](), 0
    for result in results:
        picture = None
        if result.state == "done" and pictures < MOST_PICTURES:
            picture, pictures = _picture(out / result.bake, len(results)), pictures + 1
        entries.append(_entry(result, picture))
    return entries


def _entry(result: JobResult, picture: NDArray[np.float32] | None) -> GalleryEntry:
    reason = None
    if result.state == "failed":
        reason = ": ".join(filter(None, [result.signal, result.reason])) or "failed"
    report = result.then.get("validate", {}).get("report") if isinstance(result.then.get("validate"), dict) else None
    return GalleryEntry(
        name=result.name,
        values=result.values,
        picture=picture,
        error=result.error,
        seconds=result.seconds,
        bytes=result.bytes,
        report=report,
        reason=reason,
    )


def _picture(bake: Path, jobs: int) -> NDArray[np.float32] | None:
    """Small picture of the first stored view; None if its map is gone or damaged."""
    with suppress(RsibrError):
        return thumbnail(read_map(bake / MAPS_NAME / FIRST_MAP).radiance, jobs)
    return None
