"""Publishing of a bake: files that other programs read."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from numpy.typing import ArrayLike

from rsibr import backend
from rsibr.errors import InputError, printable
from rsibr.job_size import JobSize
from rsibr.progress import Job
from rsibr.publishing.published_view import PublishedLight, PublishedView
from rsibr.publishing.registry import Encoded, Format, format_of, formats_of
from rsibr.publishing.view_source import ViewSource
from rsibr.shown_progress import shows_progress
from rsibr.store.atomic import write_atomic
from rsibr.store.bake import open_bake
from rsibr.store.directory import make_folder
from rsibr.store.stored_maps import StoredMaps

_Job = tuple[list[Format], int, Callable[[], PublishedView | PublishedLight]]
"""Formats, subjects of the same size that are left, and what makes the subject."""

Formats = str | Iterable[str] | Mapping[str, Mapping[str, object]]
"""Names with options, `NAME[,OPTION=VALUE]…`; or options by name."""


@dataclass(frozen=True)
class Published:
    """Files that were written.

    Attributes
    ----------
    files : tuple of Path
        In the order of their making: view by view, format by format.
    notes : tuple of str
        What a user should know, such as values that a format cannot hold, each with its file.
    views : int
        Number of views.
    seconds : float
        Wall time [s].
    """

    files: tuple[Path, ...]
    notes: tuple[str, ...]
    views: int
    seconds: float


@shows_progress(Job("publish"))
@backend.in_session
def publish(
    bake: StoredMaps | Path | str,
    views: str | ArrayLike | None,
    formats: Formats,
    out: Path | str,
    *,
    method: str | None = None,
    resolution: int | None = None,
    fresh: bool = False,
    allow_large: bool = False,
    on_progress: Callable[[int, int], None] | None = None,
) -> Published:
    """Write files that other programs read: environment maps, matcaps, cubes, light.

    A file of a view holds the reflection of that view only, and says so. Indexed by the mirror direction r it is L_r
    seen by the viewer in direction v from a surface whose mirror direction is r, with the normal (r + v)/|r + v|.

    Parameters
    ----------
    bake : Bake or path
        A finished bake.
    views : "all" or array_like, shape (3,) or (V, 3), or None
        Directions from the surface to the viewer; `"all"` for the stored views; None where only the light is published.
        One direction given as such writes `NAME.ENDING`, several `NAME.asked_0000.ENDING`, and all
        `NAME.view_0000.ENDING`, numbered as the stored maps.
    formats : str, iterable of str, or dict
        Names of formats, with options: `"latlong-exr,size=512,ktx2"`,
        `["latlong-exr,size=512", "ktx2"]`, or `{"latlong-exr": {"size": 512}, "ktx2": {}}`.
    out : path
        Folder for the files; it is made if absent.
    method : str, optional
        Name of a method. By default that of `rsibr.reconstruct`; all stored views are published from their maps as they
        were rendered, unless a method or a resolution is given.
    resolution : int, optional
        Texels a side of the sphere maps that files are made from, 8 to 4096; by default that of the bake.
    fresh : bool
        Replace files that are there. By default nothing is written if one is.
    allow_large : bool
        Start even if it exceeds the free memory or disk space.
    on_progress : callable, optional
        Called with the number of views done and their total; the light counts as one.

    Returns
    -------
    Published

    Raises
    ------
    InputError
        If a format, an option, a method or a view is unknown or invalid; if a file is there already; if a map is not
        finite; if the bake does not know its lobes apart, for a format that needs them.
    BakeError
        If the bake cannot be read, or lacks something that the method requires.

    Examples
    --------
    >>> made = rsibr.publish("out/paint.rsibr", (1, 2, 3), "latlong-exr,ktx2", "out/files")     # doctest: +SKIP
    >>> [file.name for file in made.files]                                                       # doctest: +SKIP
    ['paint.latlong.exr', 'paint.ktx2']
    """
    start, folder = time.perf_counter(), Path(out)
    chosen = _chosen(formats)
    of_views, of_light = ([one for one in chosen if one.of == of] for of in ("view", "light"))
    opened = open_bake(Path(bake)) if isinstance(bake, Path | str) else bake
    stem = stem_of(opened.path)
    if views is None and of_views:
        raise InputError("no view is named", where="views", fix="give a direction, or 'all'")
    source = ViewSource.of(
        opened, "all" if views is None else views, method, resolution, split=any(one.passes for one in of_views)
    )
    places = [f"{stem}.{name}" if name else stem for name in source.names] if of_views else []
    endings = [(place, one) for place in places for one in of_views] + [(stem, one) for one in of_light]
    writers = _writers([(f"{place}.{ending}", one.name) for place, one in endings for ending in one.files])
    _check_absent([folder / name for name in writers], fresh)
    source.admit(allow_large)

    jobs: list[_Job] = [(of_light, 1, partial(_light, opened, stem))] if of_light else []
    jobs += [(of_views, len(places) - k, partial(source.view, k, place)) for k, place in enumerate(places)]
    files: list[Path] = []
    notes: list[str] = list(source.notes)
    for done, (wanted, left, make) in enumerate(jobs):
        subject = make()
        made = [(one, one.encode(subject)) for one in wanted]
        size = left * sum(len(data) for _, encoded in made for data in encoded.files.values())
        JobSize(f"publication of {left} view{'s' * (left != 1)}", disk=size).admit(folder, allow_large)
        make_folder(folder)
        for one, encoded in made:
            files += _written(folder, subject.stem, one, encoded)
            notes += [f"{subject.stem}, {one.name}: {note}" for note in encoded.notes]
        if on_progress is not None:
            on_progress(done + 1, len(jobs))
    return Published(tuple(files), tuple(notes), len(places), time.perf_counter() - start)


def stem_of(bake: Path) -> str:
    """Beginning of the names of files of a bake: its own, without its ending and characters that names may not hold.

    Examples
    --------
    >>> stem_of(Path("out/red paint.rsibr"))
    'red_paint'
    """
    name = bake.absolute().name.removesuffix(".rsibr")
    return re.sub(r"[^\w.-]+", "_", name).strip("._") or "bake"


def _chosen(formats: Formats) -> list[Format]:
    if isinstance(formats, Mapping):
        return [format_of(name, options) for name, options in formats.items()]
    return formats_of([formats] if isinstance(formats, str) else formats)


def _light(bake: StoredMaps, stem: str) -> PublishedLight:
    return PublishedLight(stem, bake.manifest.environment.name, bake.light)


def _writers(files: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Format of each file name; an InputError if two formats write one."""
    writers: dict[str, str] = {}
    for file, name in files:
        if writers.setdefault(file, name) != name:
            fix = "publish them into two folders"
            raise InputError(f"{writers[file]} and {name} both write {file}", where="formats", fix=fix)
    return writers


def _check_absent(files: Sequence[Path], fresh: bool) -> None:
    """Raise an InputError that names a file that is there already, unless it may be replaced."""
    found = [] if fresh else [file for file in files if os.path.lexists(file)]
    if found:
        more = f", as are {len(found) - 1} more" if len(found) > 1 else ""
        what = f"{printable(found[0])} is there already{more}"
        raise InputError(what, where="out", fix="choose another folder, or replace them (--fresh)")


def _written(folder: Path, stem: str, one: Format, encoded: Encoded) -> Iterator[Path]:
    for ending in one.files:
        file = folder / f"{stem}.{ending}"
        write_atomic(file, encoded.files[ending])
        yield file
