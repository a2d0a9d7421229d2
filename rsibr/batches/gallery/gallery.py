"""Gallery of a batch: a contact sheet of all jobs, in one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np

from rsibr.batches.gallery.contact_sheet import contact_sheets, matrix_keys
from rsibr.batches.gallery.entry import GalleryEntry
from rsibr.batches.gallery.thumbnail import MOST_PICTURES, thumbnail, thumbnail_side
from rsibr.batches.gallery.tone_curve import ToneCurve
from rsibr.store.atomic import write_atomic
from rsibr.store.png_file import tone_mapped
from rsibr.validation.report import pictures
from rsibr.validation.report.page import render

GALLERY_NAME = "gallery.html"

_MOST_FAILURES = 200
"""Maximum number of failed jobs that are listed with their reason above the sheet."""


@dataclass(frozen=True, eq=False)
class _Totals:
    """Sums over all jobs, those without a picture included."""

    jobs: int
    failed: int
    seconds: float
    bytes: int
    worst: GalleryEntry | None
    median_error: float | None

    @classmethod
    def of(cls, entries: Sequence[GalleryEntry]) -> _Totals:
        judged = [entry for entry in entries if entry.error is not None]
        return cls(
            jobs=len(entries),
            failed=sum(entry.failed for entry in entries),
            seconds=sum(entry.seconds or 0.0 for entry in entries),
            bytes=sum(entry.bytes or 0 for entry in entries),
            worst=max(judged, key=lambda entry: entry.error or 0.0, default=None),
            median_error=median(entry.error or 0.0 for entry in judged) if judged else None,
        )


@dataclass(frozen=True, eq=False)
class _Job:
    """A job with its place in the batch and its picture as a data URI; None without a picture."""

    number: int
    entry: GalleryEntry
    uri: str | None

    @property
    def values(self) -> dict[str, object]:
        """Values of the matrix keys."""
        return dict(self.entry.values)


def write_gallery(out: Path, entries: Sequence[GalleryEntry], title: str) -> Path:
    """Write the gallery of a batch.

    Parameters
    ----------
    out : Path
        Directory of the batch; reports are linked relative to it.
    entries : sequence of GalleryEntry
        All jobs, in the order of the batch. At most `MOST_PICTURES` of them are in the page, failed ones first; the
        page says how many more there are. Their pictures may be `thumbnail`s already.
    title : str
        Name of the batch.

    Returns
    -------
    Path
        `out / "gallery.html"`, written atomically: about 5 kB a job, and a few MiB at most.

    Raises
    ------
    BakeError, MachineError
        If it cannot be written.

    Examples
    --------
    >>> write_gallery(Path("out/zoo"), [GalleryEntry("red/noon", {"material": "red", "sky": "noon"})], "zoo")
    ... # doctest: +SKIP
    PosixPath('out/zoo/gallery.html')
    """
    listed = _listed(entries)
    small = [_with_thumbnail(entry, len(listed)) for _, entry in listed]
    curve = ToneCurve.of(entry.picture for entry in small if entry.picture is not None)
    jobs = [_Job(number, entry, _uri(entry, curve)) for (number, _), entry in zip(listed, small, strict=True)]
    page = render(
        "gallery.html.j2",
        package="rsibr.batches.gallery",
        title=title,
        keys=matrix_keys(jobs),
        sheets=contact_sheets(jobs),
        failures=[job for job in jobs if job.entry.failed][:_MOST_FAILURES],
        totals=_Totals.of(entries),
        shown=len(jobs),
        side=thumbnail_side(len(listed)),
        curve=curve,
    )
    write_atomic(out / GALLERY_NAME, page.encode())
    return out / GALLERY_NAME


def _listed(entries: Sequence[GalleryEntry]) -> list[tuple[int, GalleryEntry]]:
    """Jobs that are in the page, with their numbers, in the order of the batch."""
    numbered = list(enumerate(entries, 1))
    failed_first = sorted(numbered, key=lambda one: not one[1].failed)
    return sorted(failed_first[:MOST_PICTURES], key=lambda one: one[0])


def _with_thumbnail(entry: GalleryEntry, jobs: int) -> GalleryEntry:
    return entry if entry.picture is None else replace(entry, picture=thumbnail(entry.picture, jobs))


def _uri(entry: GalleryEntry, curve: ToneCurve) -> str | None:
    if entry.picture is None:
        return None
    opaque = np.ones(entry.picture.shape[:2])
    return pictures.data_uri(tone_mapped(curve(entry.picture), opaque, exposure=1.0))
