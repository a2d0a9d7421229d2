"""Values of the matrix: short forms, patterns of files and presets, and the short name of each value.

| key | value | stands for |
|---|---|---|
| `material` | `"solid-red"`, `"metallic-*"` | presets |
| `material` | `{file = "materials/*.xml"}` | each file; other keys of `[material]` may stand beside it |
| `environment` | `"skies/*.exr"`, `{file = "skies/*.exr", rotation_deg = 90}` | each file |
| `views.file`, … | `"views/*.json"` | each file |
| `map.resolution`, … | `256` | itself |

A table of `material` and `environment` takes the place of the base's table; its key `name`, if it has one, is its short
name. Relative paths start at the folder of the batch file.
"""

from __future__ import annotations

import glob
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import Any

from rsibr.errors import InputError
from rsibr.geometry.projections.faces import FACES
from rsibr.regular_file import is_file
from rsibr.scene.presets import PRESETS

SHORT_FORMS: Mapping[str, str] = {"material": "preset", "environment": "file"}
"""Tables of the config that a key of the matrix may name as a whole, and the key that a mere string stands for."""

_FILE_KEYS = ("file", "filename")


@dataclass(frozen=True)
class Value:
    """One value of a key of the matrix.

    Attributes
    ----------
    key : str
        Key of the matrix.
    label : str
        Short name, unique among the values of its key.
    shown : Any
        The value itself if it is a number, a string or a truth value, otherwise its label.
    setting : Any
        What takes the place of the base's value; paths are absolute.
    place : str
        Where it stands in the batch file, as "matrix.material[2]".
    """

    key: str
    label: str
    shown: Any
    setting: Any
    place: str

    @property
    def section(self) -> str:
        """Table of the config that it belongs to."""
        return self.key.partition(".")[0]

    @cached_property
    def identity(self) -> str:
        """Text that equal values share."""
        return json.dumps(self.setting, sort_keys=True)

    def is_called(self, wanted: Any) -> bool:
        """Whether it equals a number or a truth value, or its short name matches a text, which may be a pattern."""
        if isinstance(wanted, str):
            return self.label == wanted or fnmatchcase(self.label, wanted)
        return isinstance(wanted, bool) == isinstance(self.shown, bool) and bool(self.shown == wanted)


def values_of(key: str, written: Any, folder: Path, where: str, place: str) -> Iterator[Value]:
    """Values that one entry of the matrix stands for: several, if it is a pattern.

    Raises
    ------
    InputError
        If a pattern matches nothing.
    """
    if key in SHORT_FORMS:
        written = {SHORT_FORMS[key]: written} if isinstance(written, str) else written
        if not isinstance(written, Mapping):
            what = f"{key} = {json.dumps(written)} should be a name in quotes, or a table"
            raise InputError(what, where=f"{where}, {place}")
    name = None
    if key in SHORT_FORMS and "name" in written:
        name = str(written["name"])
        written = {inner: value for inner, value in written.items() if inner != "name"}
    for one in _each(key, written, folder, f"{where}, {place}"):
        setting = _absolute(key.rpartition(".")[2], one, folder)
        label = name if name is not None else label_of(key, one)
        shown = setting if isinstance(setting, bool | int | float) else label
        yield Value(key, label, shown, setting, place)


def label_of(key: str, setting: Any) -> str:
    """Short name of a value: stem of a file, type of a plugin, name of a preset, or the value as text."""
    if isinstance(setting, Mapping):
        return _table_label(setting)
    if isinstance(setting, bool):
        return str(setting).lower()
    if isinstance(setting, list):
        return ",".join(label_of("", one) for one in setting)
    return Path(setting).stem if isinstance(setting, str) and key.rpartition(".")[2] in _FILE_KEYS else str(setting)


def _table_label(table: Mapping[str, Any]) -> str:
    """Name of what a material or an environment is made from."""
    for key in ("preset", "file", "bsdf", "emitter", "faces", "type"):
        if key in table:
            return _faces_label(table[key]) if key == "faces" else label_of(key, table[key])
    return "table"


def _faces_label(faces: Any) -> str:
    """What the names of the six files begin with, or their folder."""
    if isinstance(faces, Mapping):
        letters = zip(*(Path(str(path)).stem for path in faces.values()), strict=False)
        common = "".join(same[0] for same in takewhile(lambda one: len(set(one)) == 1, letters))
        place = Path(str(next(iter(faces.values()), "")))
    else:
        common, place = Path(str(faces)).stem.replace("{face}", ""), Path(str(faces))
    return common.strip("_-. ") or place.parent.name or "cube"


def _each(key: str, written: Any, folder: Path, where: str) -> Iterator[Any]:
    """Each setting that a value with a pattern stands for; the value itself without one."""
    leaf = key.rpartition(".")[2]
    if isinstance(written, Mapping) and key in SHORT_FORMS:
        inner = next((name for name in ("preset", *_FILE_KEYS) if isinstance(written.get(name), str)), None)
        if inner is None:
            yield written
            return
        for found in _matches(inner, written[inner], key, folder, where):
            yield {**written, inner: found}
    elif isinstance(written, str) and (leaf in _FILE_KEYS or key == "material.preset"):
        yield from _matches(leaf, written, key, folder, where)
    else:
        yield written


def _matches(leaf: str, pattern: str, key: str, folder: Path, where: str) -> list[str]:
    """Presets or files that match a pattern, sorted; a name without one stands for itself."""
    if not glob.has_magic(pattern):
        return [pattern]
    if leaf == "preset":
        found, kind = [name for name in PRESETS if fnmatchcase(name, pattern)], "preset"
        fix = f'name files with {{file = "{pattern}"}}' if "/" in pattern or pattern.endswith(".xml") else ""
    else:
        if is_file(folder / pattern):  # a name that looks like a pattern
            return [pattern]
        found, kind, fix = _files(pattern, folder, where), "file", "check the pattern"
    if not found:
        raise InputError(f'{key} = "{pattern}" matches no {kind}', where=where, fix=fix)
    return found


def _files(pattern: str, folder: Path, where: str) -> list[str]:
    """Files that match a pattern, sorted."""
    place = _expanded(pattern)
    start, relative = (Path(place.anchor), place.relative_to(place.anchor)) if place.is_absolute() else (folder, place)
    try:
        return sorted(str(path) for path in start.glob(str(relative)) if path.is_file())
    except ValueError as error:
        raise InputError(f'"{pattern}" is no pattern of files: {error}', where=where) from None


def _absolute(leaf: str, value: Any, folder: Path) -> Any:
    """Make the paths in a value absolute: they are relative to the batch file, not to its base config."""
    if isinstance(value, Mapping) and leaf == "faces":
        return {name: _path(path, folder) for name, path in value.items()}
    if isinstance(value, Mapping):
        return {name: _absolute(name, inner, folder) for name, inner in value.items()}
    if leaf == "modules" and isinstance(value, list):
        return [_path(one, folder) if isinstance(one, str) and one.endswith(".py") else one for one in value]
    if isinstance(value, list):
        return [_absolute("", inner, folder) for inner in value]
    return _path(value, folder) if leaf in (*_FILE_KEYS, "faces", *FACES) else value


def _path(value: Any, folder: Path) -> Any:
    return str(folder / _expanded(value)) if isinstance(value, str) and value else value


def _expanded(path: str) -> Path:
    """Path with `~` expanded; as it is, where no one has that name: the config then says so."""
    try:
        return Path(path).expanduser()
    except RuntimeError:
        return Path(path)
