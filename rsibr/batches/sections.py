"""Settings of jobs from sections of the config that are each validated once, however many jobs share them.

A section's values are checked by the model of the config, without any other section: a thousand materials under two
hundred skies are 1200 checks, not 200 000. Sections whose validity depends on each other are checked together
(`rsibr.scene.config.CHECKED_TOGETHER`). Beside the model, the files that a section names are looked at: an environment
begins like OpenEXR or Radiance, a material is well-formed XML with all files that it names, a preset exists.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsibr.batches.values import SHORT_FORMS, Value
from rsibr.errors import InputError, RsibrError
from rsibr.regular_file import is_file, read_regular
from rsibr.scene.config import CHECKED_TOGETHER, Config, EnvironmentConfig, MaterialConfig, ViewsConfig, parse_config
from rsibr.scene.overrides import with_values
from rsibr.scene.panorama.source import is_exr
from rsibr.scene.plugin import require_files
from rsibr.scene.presets import preset_file
from rsibr.scene.xml_files import XmlFiles

PLACEHOLDERS: Mapping[str, dict[str, Any]] = {
    "environment": {"emitter": {"type": "constant"}},
    "material": {"preset": "matte-lambert"},
}
"""Valid tables of the sections that a config must have, in place of those that are not being checked."""


@dataclass(frozen=True)
class Part:
    """Checked sections that belong together.

    Attributes
    ----------
    tables : dict
        Sections as `Config.to_dict` returns them.
    members : tuple of str
        Canonical JSON of each, as a member of an object: `"map":{"resolution":256}`.
    problems : tuple of str
        What is wrong with them, each in one line.
    """

    tables: Mapping[str, Any]
    members: tuple[str, ...]
    problems: tuple[str, ...] = ()


class Sections:
    """Base config with the values of jobs laid over it, section by section.

    Parameters
    ----------
    base : mapping
        Tables of the base config.
    folder : Path
        Folder at which its paths start.
    base_where, where : str
        What errors in the base, and in the batch file, name.
    """

    def __init__(self, base: Mapping[str, Any], folder: Path, base_where: str, where: str) -> None:
        self._base, self._folder, self._base_where, self._where = base, folder, base_where, where
        self._parts: dict[tuple[Any, ...], Part] = {}
        self._groups: dict[str, tuple[str, ...]] = {name: (name,) for name in Config.model_fields}
        for together in CHECKED_TOGETHER:
            self._groups |= dict.fromkeys(together, together)
        self._every = tuple(dict.fromkeys(self._groups.values()))
        unknown = {name: table for name, table in base.items() if name not in self._groups}
        if unknown:
            parse_config({**PLACEHOLDERS, **unknown}, folder, where=base_where)  # raises, with the nearest known key

    def require_key(self, key: str, place: str) -> None:
        """Raise an InputError with the nearest known key, if the first part of `key` is no section."""
        if key.partition(".")[0] not in self._groups:
            parse_config(with_values(PLACEHOLDERS, {key: None}), self._folder, where=f"{self._where}, {place}")

    @property
    def checked(self) -> int:
        """Number of checks so far."""
        return len(self._parts)

    def layout(self, keys: Sequence[str]) -> Layout:
        """Checks of the sections of jobs that all have values of these keys."""
        by_group: dict[tuple[str, ...], list[int]] = {}
        for position, key in enumerate(keys):
            by_group.setdefault(self._groups[key.partition(".")[0]], []).append(position)
        same = [self.part(group, ()) for group in self._every if group not in by_group]
        return Layout(self, _joined(same), tuple(by_group.items()))

    def part(self, group: tuple[str, ...], values: tuple[Value, ...]) -> Part:
        """Checked sections of a group with these values; checked at the first use."""
        key = (group, *map(id, values))
        found = self._parts.get(key)
        if found is None:
            found = self._parts[key] = self._checked(group, values)
        return found

    def _checked(self, group: tuple[str, ...], values: tuple[Value, ...]) -> Part:
        places = " with ".join(value.place for value in values)
        where = f"{self._where}, {places}" if values else self._base_where
        own = {name: self._base[name] for name in group if name in self._base}
        others = {name: table for name, table in PLACEHOLDERS.items() if name not in group}
        try:
            ordered = sorted(values, key=lambda value: value.key not in SHORT_FORMS)  # a whole table, then its keys
            tables = with_values(own, {value.key: value.setting for value in ordered})
            config = parse_config({**others, **tables}, self._folder, where=where)
            _check_files(config, group)
        except RsibrError as error:
            return Part({}, (), (_told(error, where),))
        whole = config.to_dict()
        kept = {name: whole[name] for name in group if name in whole}
        return Part(kept, tuple(f'"{name}":{canonical_text(table)}' for name, table in kept.items()))


@dataclass(frozen=True)
class Layout:
    """Sections of jobs that have values of the same keys: those that are always the base's, and the varied ones."""

    sections: Sections
    _same: Part
    _varied: tuple[tuple[tuple[str, ...], list[int]], ...]

    def part(self, values: Sequence[Value]) -> Part:
        """All sections of a job; each combination of the values of a section is checked once."""
        part = self.sections.part
        return _joined([self._same, *[part(group, tuple([values[n] for n in at])) for group, at in self._varied]])


def _joined(parts: Sequence[Part]) -> Part:
    tables: dict[str, Any] = {}
    members: list[str] = []
    problems: list[str] = []
    for part in parts:
        tables.update(part.tables)
        members.extend(part.members)
        problems.extend(part.problems)
    return Part(tables, tuple(members), tuple(problems))


def digest_of(part: Part) -> str:
    """Digest of the sections of a whole config, as `rsibr.batches.job.settings_digest` has it."""
    return hashlib.sha256(f"{{{','.join(sorted(part.members))}}}".encode()).hexdigest()


def canonical_text(value: Any) -> str:
    """Canonical JSON of a section."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _told(error: RsibrError, where: str) -> str:
    """Problem in one line that begins with its place in the batch file."""
    text = str(error)
    return text if text.startswith(where) else f"{where}: {text}"


def _check_files(config: Config, group: Sequence[str]) -> None:
    """Check what can be told of the named files without Mitsuba."""
    if "environment" in group:
        _check_environment(config.environment)
    if "material" in group:
        _check_material(config.material)
    if "views" in group:
        _check_views(config.views)


def _check_environment(environment: EnvironmentConfig) -> None:
    if environment.emitter is not None:
        require_files(environment.emitter, "environment.emitter")
    for file in filter(None, [environment.file, *(environment.faces or {}).values()]):
        is_exr(file)


def _check_material(material: MaterialConfig) -> None:
    if material.preset is not None:
        preset_file(material.preset)
    elif material.bsdf is not None:
        require_files(material.bsdf, "material.bsdf")
    elif material.file is not None:
        if not is_file(material.file):
            raise InputError("there is no such material file", where=str(material.file), fix="check the path")
        XmlFiles.of(material.file, str(material.file))


def _check_views(views: ViewsConfig) -> None:
    if views.file is not None:
        view_count(views)


def view_count(views: ViewsConfig) -> int:
    """Number of stored views, without Mitsuba.

    Raises
    ------
    InputError
        If the file of views is no JSON with directions.
    """
    if views.file is None:
        return 10 * (1 << 2 * views.level) + 2
    where = str(views.file)
    try:
        count: int = len(json.loads(read_regular(views.file))["directions"])
        return count
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=where, fix="check views.file") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError('is no JSON with "directions"', where=where) from None
