"""Maps that another program made: a folder of EXR files, or a CSV that lists files and views."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError, RsibrError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.methods.registry import registrations
from rsibr.store.atomic import checksum, read_bytes
from rsibr.store.exr import open_exr
from rsibr.store.map_file import FRAME_KEY, VIEW_KEY

LIST_NAME = "views.csv"
"""CSV in a folder of maps, for files whose headers hold no view."""

COLUMNS = ("file", "x", "y", "z")

_UNIT = 1e-3
"""Largest deviation of a view's length from 1, and of two statements of one view; lists are typed by hand."""

_SAME = 1e-4
"""Largest difference of the components of two frames that count as one."""

_FLOAT32 = 1e-5
"""Rounding of a frame in a header."""

_NAME = re.compile(r"\w[\w.-]{0,39}")

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ExternalMap:
    """Map of one view.

    Attributes
    ----------
    file : Path
    frame : ndarray, shape (3, 3)
        Columns x (right), y (up), z = view in world coordinates.
    image : ndarray, shape (N, N, 3), float32
        Radiance [W sr⁻¹ m⁻²], row 0 at the top.
    digest : str
        SHA-256 of the file.
    """

    file: Path
    frame: Array
    image: NDArray[np.float32]
    digest: str

    @property
    def view(self) -> Array:
        """Direction from the surface to the viewer."""
        return np.asarray(self.frame[:, 2])


@dataclass(frozen=True)
class External:
    """`NAME=PLACE` as a user gave it.

    Attributes
    ----------
    name : str
        Name of the system.
    place : Path
        Folder, or CSV file.
    """

    name: str
    place: Path

    @property
    def where(self) -> str:
        """Place in errors."""
        return f"--external {self.name}={self.place}"


def parse_externals(texts: Sequence[str]) -> list[External]:
    """Parse `NAME=PLACE`; names are unique, and no method's.

    Raises
    ------
    InputError
        If a text has another form, a name is taken, or a place does not exist.
    """
    found = dict[str, External]()
    for text in texts:
        name, _, place = text.partition("=")
        if not place or not _NAME.fullmatch(name):
            fix = "give NAME=DIR, the name of letters, digits, '-', '_' and '.'"
            raise InputError(f"'{text[:100]}' is no name with a folder", where="--external", fix=fix)
        if name in registrations():
            raise InputError(f"'{name}' is the name of a method", where="--external", fix="choose another name")
        if name in found:
            raise InputError(f"the name '{name}' is given twice", where="--external", fix="choose another name")
        found[name] = External(name, Path(place))
        if not Path(place).exists():
            raise InputError("there is no such folder or CSV file", where=found[name].where, fix="check the path")
    return list(found.values())


def maps_of_scenes(external: External, scenes: Mapping[str, int]) -> dict[str, list[ExternalMap]]:
    """Read the maps of every scene.

    Parameters
    ----------
    external : External
    scenes : mapping of str to int
        Folder name of each scene, and texels a side of its maps.

    Returns
    -------
    dict of str to list of ExternalMap
        Maps of each scene, in the order of the file names or of the list.

    Raises
    ------
    InputError
        If a scene has no maps, or a file is wrong.
    """
    return {name: _maps(external, _place(external, name, len(scenes)), side) for name, side in scenes.items()}


def common_frames(maps: Mapping[str, Sequence[ExternalMap]]) -> list[Array]:
    """Frames of the maps of one scene, which all external systems share; the order is that of the first system.

    Raises
    ------
    InputError
        If a system lacks a view of another, or shows it in another frame.
    """
    first, *others = maps.items()
    for name, found in others:
        for (one, theirs), (another, ours) in (((name, found), first), (first, (name, found))):
            for theirs_map in theirs:
                _same_frame(theirs_map, one, ours, another)
    return [one.frame for one in first[1]]


def map_at(maps: Sequence[ExternalMap], frame: Array) -> ExternalMap:
    """Return the map with this frame; StopIteration if there is none."""
    return next(one for one in maps if np.allclose(one.frame, frame, rtol=0, atol=_SAME))


def _same_frame(wanted: ExternalMap, its_name: str, maps: Sequence[ExternalMap], name: str) -> None:
    view = _shown(wanted.view)
    near = [one for one in maps if np.allclose(one.view, wanted.view, rtol=0, atol=_SAME)]
    where, fix = f"--external {name}", "all systems are compared on the same views: give each map to each"
    if not near:
        raise InputError(f"has no map of the view {view}, which '{its_name}' has", where=where, fix=fix)
    if not np.allclose(near[0].frame, wanted.frame, rtol=0, atol=_SAME):
        fix = f"give both the same {FRAME_KEY}"
        raise InputError(f"shows the view {view} in another frame than '{its_name}'", where=where, fix=fix)


def _place(external: External, scene: str, count: int) -> Path:
    """Where the maps of a scene are: a folder or list of its name, or the whole place if there is one scene."""
    if external.place.is_dir():
        for place in (external.place / scene, external.place / f"{scene}.csv"):
            if place.exists():
                return place
    if count > 1:
        fix = f"name it {external.place / scene}; each scene has a folder or CSV of its own"
        raise InputError(f"has no maps of the scene '{scene}'", where=external.where, fix=fix)
    return external.place


def _maps(external: External, place: Path, side: int) -> list[ExternalMap]:
    found = [_read(file, view, side) for file, view in _listed(place)]
    if not found:
        raise InputError("holds no EXR file", where=str(place), fix=f"put the maps of '{external.name}' there")
    for number, one in enumerate(found):
        for other in found[:number]:
            if np.allclose(one.view, other.view, rtol=0, atol=_SAME):
                what = f"shows the view {_shown(one.view)}, as does {other.file.name}"
                raise InputError(what, where=str(one.file), fix="give one map a view")
    return found


def _listed(place: Path) -> Iterator[tuple[Path, Array | None]]:
    """Files of maps, with their views where a CSV lists them."""
    table = place / LIST_NAME if place.is_dir() else place
    if table.is_file():
        yield from _rows(table)
    else:
        for file in sorted(place.iterdir()):
            if file.suffix.lower() == ".exr" and not file.name.startswith("."):
                yield file, None


def _rows(table: Path) -> Iterator[tuple[Path, Array | None]]:
    try:
        text = read_bytes(table).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is no CSV: it is not UTF-8", where=str(table), fix="save it as UTF-8") from None
    rows = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
    if missing:
        fix = f"begin it with the line {','.join(COLUMNS)}"
        raise InputError(f"has no column {', '.join(missing)}", where=str(table), fix=fix)
    for row in rows:
        where = f"{table}, line {rows.line_num}"
        try:
            view = np.array([float(row[axis]) for axis in COLUMNS[1:]])
        except (TypeError, ValueError):
            raise InputError("x, y, z are not three numbers", where=where, fix="give a unit view vector") from None
        if not row["file"]:
            raise InputError("names no file", where=where, fix="name an EXR file beside the list")
        yield table.parent / row["file"], _checked_view(view, where)


def _read(file: Path, view: Array | None, side: int) -> ExternalMap:
    data, where = _content(file), str(file)
    frame = _frame(_header(data, where, side), view, where)
    image = _pixels(data, where)
    bad = np.argwhere((texel_coverage(side) > 0)[..., None] & ~np.isfinite(image))
    if len(bad):
        row, column, channel = bad[0]
        what = f"radiance is {image[row, column, channel]} in row {row}, column {column} ({len(bad)} such values)"
        raise InputError(what, where=where, fix="give finite radiance wherever a texel overlaps the disk")
    return ExternalMap(file, frame, image, checksum(data))


def _content(file: Path) -> bytes:
    if not file.is_file():
        raise InputError("there is no such file", where=str(file), fix="correct the list of maps")
    try:
        return read_bytes(file)
    except RsibrError as error:
        raise InputError(error.what, where=str(file)) from error


def _header(data: bytes, where: str, side: int) -> Mapping[str, Any]:
    """Header of the first part of a map of `side`² texels; pixels are not read, however many it announces."""
    with _first_part(data, where, header_only=True) as part:
        header = dict(part.header)
        low, high = np.asarray(header["dataWindow"])
        width, height = (int(sides) for sides in high.astype(np.int64) - low + 1)
    if (width, height) != (side, side):
        what, fix = f"is {width}×{height}, and the maps compared are {side}×{side}", f"render it at {side}×{side}"
        raise InputError(what, where=where, fix=fix)
    return header


def _pixels(data: bytes, where: str) -> NDArray[np.float32]:
    """R, G, B of the first part."""
    with _first_part(data, where) as part:
        pixels = {name: channel.pixels for name, channel in part.channels.items()}
        # OpenEXR's Python package joins channels R, G, B (and A) into one array
        for name in ("RGB", "RGBA"):
            if name in pixels:
                return np.ascontiguousarray(pixels[name][..., :3], np.float32)
        if {"R", "G", "B"} <= set(pixels):
            return np.stack([pixels[name] for name in "RGB"], axis=-1).astype(np.float32)
    what = f"has the channels {', '.join(sorted(pixels)) or 'none'} in its first part, not R, G, B"
    raise InputError(what, where=where, fix="save it as RGB")


@contextmanager
def _first_part(data: bytes, where: str, *, header_only: bool = False) -> Iterator[Any]:
    """First part of an OpenEXR file; whatever is wrong with it is an InputError."""
    try:
        with open_exr(io.BytesIO(data), header_only=header_only) as file:
            yield file.parts[0]
    except (RuntimeError, ValueError, TypeError, LookupError, OSError, MemoryError):
        raise InputError("is no whole OpenEXR file", where=where, fix="write it anew") from None


def _frame(header: Mapping[str, Any], listed: Array | None, where: str) -> Array:
    """Frame of a map: from its header, or upright about the view that the list or the header has."""
    frame = _attribute(header, FRAME_KEY, (3, 3), where)
    view = _attribute(header, VIEW_KEY, (3,), where)
    if frame is not None and not _is_rotation(frame):
        fix = "give unit columns x (right), y (up), z = view, right-handed"
        raise InputError(f"{FRAME_KEY} is no rotation", where=where, fix=fix)
    stated = {"the list": listed, VIEW_KEY: view, FRAME_KEY: None if frame is None else frame[:, 2]}
    views = {name: _checked_view(one, where) for name, one in stated.items() if one is not None}
    if not views:
        fix = f"write the attribute {VIEW_KEY} (v3f) or {FRAME_KEY} (m33f), or list files and views in {LIST_NAME}"
        raise InputError(f"its header has neither {VIEW_KEY} nor {FRAME_KEY}", where=where, fix=fix)
    (first, said), *others = views.items()
    for name, one in others:
        if not np.allclose(one, said, rtol=0, atol=_UNIT):
            what = f"the view is {_shown(said)} in {first} and {_shown(one)} in {name}"
            raise InputError(what, where=where, fix="let the two agree")
    upright = view_frame(said if frame is None else frame[:, 2])  # in double precision, as the methods' own
    return upright if frame is None or np.allclose(upright, frame, rtol=0, atol=_FLOAT32) else frame


def _attribute(header: Mapping[str, Any], name: str, shape: tuple[int, ...], where: str) -> Array | None:
    if name not in header:
        return None
    try:
        value = np.asarray(header[name], np.float64)
        if value.shape == shape and np.isfinite(value).all():
            return value
    except (TypeError, ValueError):
        pass
    kind = "v3f" if shape == (3,) else "m33f"
    raise InputError(f"{name} is no attribute of {kind} with finite values", where=where, fix=f"write it as {kind}")


def _checked_view(view: Array, where: str) -> Array:
    length = float(np.linalg.norm(view))
    if not abs(length - 1) <= _UNIT:
        what = f"the view {_shown(view)} has the length {length:.4g}"
        raise InputError(what, where=where, fix="give a unit vector from the surface to the viewer")
    return view


def _is_rotation(frame: Array) -> bool:
    return bool(np.allclose(frame.T @ frame, np.eye(3), rtol=0, atol=_SAME) and np.linalg.det(frame) > 0)


def _shown(view: Array) -> str:
    return "({})".format(", ".join(f"{component:.4g}" for component in view))
