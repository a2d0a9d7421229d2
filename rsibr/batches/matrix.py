"""Jobs of a batch: all combinations of the matrix, without those that are excluded, and those that are included.

- `exclude` matches in part: a combination is left out if it has all the values that a rule names.
- `include` only adds: each is a job of its own, the base with these values.
- A rule or a pattern that matches nothing is an error, and so are two jobs of one name.

Jobs are made one after the other and none is kept, so that a million of them take no memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

from rsibr.batches.config import BatchConfig, base_tables
from rsibr.batches.job import Job
from rsibr.batches.names import NamePattern, NameRegister, fault_of
from rsibr.batches.sections import Layout, Sections, canonical_text, digest_of
from rsibr.batches.values import SHORT_FORMS, Value, label_of, values_of
from rsibr.errors import InputError, did_you_mean
from rsibr.scene.config import Config
from rsibr.scene.config_errors import known_keys
from rsibr.scene.overrides import apply_overrides, override_keys, parse_override

MOST_TOLD = 8
"""Mistakes that one message tells."""

NAME_KEY = "name"
"""Key of `--only` that selects by the name of a job."""

_Row = tuple[Value, ...]
_Rule = tuple[tuple[int, frozenset[int]], ...]
"""Number of an axis, and the numbers of its values that a rule names, for each key of the rule."""


@dataclass(frozen=True)
class Axis:
    """A key of the matrix with its values."""

    key: str
    values: tuple[Value, ...]


@dataclass(frozen=True)
class Matrix:
    """All jobs of a batch file. Made by `of`.

    Attributes
    ----------
    axes : tuple of Axis
        Keys of the matrix.
    rows : tuple of tuple of Value
        Values of each job that `include` adds.
    """

    config: BatchConfig
    axes: tuple[Axis, ...]
    rows: tuple[_Row, ...]
    _rules: tuple[_Rule, ...] = field(repr=False)
    _selected: Mapping[str, Sequence[Any]] = field(repr=False)
    _pattern: NamePattern = field(repr=False)
    _sections: Sections = field(repr=False)

    @classmethod
    def of(cls, config: BatchConfig, overrides: Sequence[str] = (), only: Sequence[str] = ()) -> Matrix:
        """Find what the values of a batch file stand for; jobs are made by `jobs`, and checked by `check`.

        Parameters
        ----------
        config : BatchConfig
            The batch file.
        overrides : sequence of str
            `a.b=value`, laid over the base.
        only : sequence of str
            `KEY=VALUE`: jobs that have one of the values given for each key. A value may be a pattern of short names,
            and KEY may be `name`.

        Raises
        ------
        InputError
            If a key is unknown, a pattern or a rule matches nothing, two values of a key have one name, an override
            sets what the matrix sets, or `only` selects nothing.
        """
        where, folder = config.where, config.folder
        tables, start, base_where = base_tables(config)
        sections = Sections(apply_overrides(tables, overrides), start, base_where, where)
        axes = tuple(_axis(key, found, folder, where) for key, found in config.tables.matrix.items())
        rows = tuple(row for n, table in enumerate(config.tables.include, 1) for row in _rows(n, table, folder, where))
        places = [(axis.key, f"matrix.{axis.key}") for axis in axes]
        for key, place in [*places, *((value.key, value.place) for row in rows for value in row)]:
            sections.require_key(key, place)
        if not axes and not rows:
            raise InputError("has no jobs", where=where, fix="give [matrix] or [[include]]")
        _check_overrides(override_keys(overrides), axes)
        rules = tuple(_rule(n, rule, axes, folder, where) for n, rule in enumerate(config.tables.exclude, 1))
        keys = list(dict.fromkeys([*(axis.key for axis in axes), *(value.key for row in rows for value in row)]))
        pattern = NamePattern.of(
            config.tables.name if config.tables.name is not None else "/".join(f"{{{key}}}" for key in keys),
            dict.fromkeys([*keys, *SHORT_FORMS, *(key for key in known_keys(Config) if "." in key)]),
            where,
        )
        selected = _selection(only, keys)
        return cls(config, axes, rows, rules, selected, pattern, sections)

    @property
    def checks(self) -> int:
        """Number of checks of sections so far."""
        return self._sections.checked

    def jobs(self) -> Iterator[Job]:
        """Selected jobs, in the order of the file: the first key of the matrix varies slowest, includes come last.

        They have passed `check`.
        """
        then = self.config.tables.then.steps()
        for layout, values in self._combinations():
            part = layout.part(values)
            name = self._name(values, part.tables)
            if self._is_named(name):
                yield Job(name, {value.key: value.shown for value in values}, part.tables, then, digest_of(part))

    def check(self, on_job: Callable[[Job], None] = lambda _: None) -> int:
        """Check every selected job, each distinct value once, and return their number.

        Parameters
        ----------
        on_job : callable
            Called with each job that is right.

        Raises
        ------
        InputError
            If a value or a named file is wrong, a name is no safe path, two names clash, or nothing is selected. The
            message has all mistakes, or the first `MOST_TOLD` of them.
        """
        mistakes, register, count = dict[str, None](), NameRegister(), 0
        then = self.config.tables.then.steps()
        for layout, values in self._combinations():
            part = layout.part(values)
            if part.problems:
                mistakes.update(dict.fromkeys(part.problems))
                continue
            name = self._name(values, part.tables)
            if not self._is_named(name):
                continue
            count += 1
            if fault := self._fault(name, values, register):
                mistakes.setdefault(fault)
            elif not mistakes:
                on_job(Job(name, {value.key: value.shown for value in values}, part.tables, then, digest_of(part)))
        if folder := register.folder_clash():
            mistakes.setdefault(f"{self.config.where}: the job '{folder}' is also a folder of other jobs")
        if mistakes:
            raise InputError(all_of(list(mistakes)))
        if not count:
            raise self._nothing()
        return count

    def distinct(self, section: str) -> list[Mapping[str, Any]]:
        """Distinct tables of a section among the selected jobs, in their order."""
        seen: dict[int, Mapping[str, Any]] = {}
        for layout, values in self._combinations():
            table = layout.part(values).tables.get(section)
            if table is not None:
                seen.setdefault(id(table), table)  # jobs with equal values share the table
        return list({canonical_text(table): table for table in seen.values()}.values())

    def _combinations(self) -> Iterator[tuple[Layout, _Row]]:
        """Values of each selected job with the layout of its sections, before it is selected by its name."""
        keys = [axis.key for axis in self.axes]
        if self.axes and not self._asks_beyond(keys):
            layout, rules = self._sections.layout(keys), self._rules
            chosen = [
                [(index, value) for index, value in enumerate(axis.values) if self._is_selected(value)]
                for axis in self.axes
            ]
            for numbered in product(*chosen):
                if not (rules and _is_excluded(numbered, rules)):
                    yield layout, tuple([value for _, value in numbered])
        for row in self.rows:
            keys = [value.key for value in row]
            if not self._asks_beyond(keys) and all(map(self._is_selected, row)):
                yield self._sections.layout(keys), row

    def _asks_beyond(self, keys: Sequence[str]) -> bool:
        """Whether `only` names a key that a job with these keys does not have."""
        return any(key not in keys for key in self._selected if key != NAME_KEY)

    def _is_selected(self, value: Value) -> bool:
        wanted = self._selected.get(value.key)
        return wanted is None or any(_is_meant(value, one, self.config.folder) for one in wanted)

    def _is_named(self, name: str) -> bool:
        wanted = self._selected.get(NAME_KEY)
        return wanted is None or any(name == one or fnmatchcase(name, one) for one in wanted)

    def _name(self, values: _Row, settings: Mapping[str, Any]) -> str:
        labels = {value.key: value.label for value in values}

        def label(key: str) -> str:
            return labels[key] if key in labels else label_of(key, _value_at(settings, key))

        return self._pattern.filled(label)

    def _fault(self, name: str, values: _Row, register: NameRegister) -> str:
        if fault := fault_of(name):
            return f"{self.config.where}: the name '{name}' {fault}"
        if not (clash := register.clash(name)):
            return ""
        varied = [axis.key for axis in self.axes if len(axis.values) > 1] if self.axes else []
        left_out = [key for key in dict.fromkeys([*varied, *(value.key for value in values)]) if key not in self._keys]
        hint = f": name leaves out {', '.join(left_out)}" if left_out else ""
        return f"{self.config.where}: {clash}{hint}"

    @property
    def _keys(self) -> tuple[str, ...]:
        return self._pattern.keys

    def _nothing(self) -> InputError:
        if not self._selected:
            return InputError("exclude leaves no job", where=self.config.where)
        asked = " ".join(f"{key}={value}" for key, values in self._selected.items() for value in values)
        return InputError(f"no job has {asked}", where="only")


def _is_excluded(numbered: Sequence[tuple[int, Value]], rules: Sequence[_Rule]) -> bool:
    return any(all(numbered[n][0] in among for n, among in rule) for rule in rules)


def shard_bounds(shard: tuple[int, int], count: int) -> range:
    """Numbers of the jobs of a shard, counted from 0: consecutive jobs, which share materials.

    Parameters
    ----------
    shard : (int, int)
        Number of the shard, from 1, and how many there are. All together have each job once.
    count : int
        Number of jobs.
    """
    number, of = shard
    return range(count * (number - 1) // of, count * number // of)


def _axis(key: str, entries: Sequence[Any], folder: Path, where: str) -> Axis:
    values = [
        value
        for number, entry in enumerate(entries, 1)
        for value in values_of(key, entry, folder, where, f"matrix.{key}[{number}]")
    ]
    known: dict[str, Value] = {}
    for value in values:
        other = known.setdefault(value.label, value)
        if other is not value:
            same = other.identity == value.identity
            what = f"{key} has '{value.label}' twice" if same else f"two values of {key} are called '{value.label}'"
            fix = "" if same else f'give one another name, as in {{…, name = "{value.label}-2"}}'
            raise InputError(f"{what} ({other.place}, {value.place})", where=where, fix=fix)
    return Axis(key, tuple(values))


def _rows(number: int, table: Mapping[str, Any], folder: Path, where: str) -> Iterator[_Row]:
    """Jobs that one table of `include` adds: several, if a value is a pattern."""
    each = [list(values_of(key, entry, folder, where, f"include[{number}].{key}")) for key, entry in table.items()]
    yield from product(*each)


def _rule(number: int, table: Mapping[str, Any], axes: Sequence[Axis], folder: Path, where: str) -> _Rule:
    """Values of the matrix that a table of `exclude` names."""
    keys = [axis.key for axis in axes]
    rule = []
    for key, wanted in table.items():
        place = f"{where}, exclude[{number}]"
        if key not in keys:
            fix = did_you_mean(key, keys) or f"keys of the matrix are {', '.join(keys) or 'none'}"
            raise InputError(f"the matrix has no key '{key}': the rule matches nothing", where=place, fix=fix.strip())
        axis = axes[keys.index(key)]
        among = frozenset(n for n, value in enumerate(axis.values) if _is_meant(value, wanted, folder))
        if not among:
            raise InputError(f"{key} = {wanted!r} matches nothing", where=place, fix=_known_values(axis, wanted))
        rule.append((keys.index(key), among))
    return tuple(rule)


def _is_meant(value: Value, wanted: Any, folder: Path) -> bool:
    """Whether a value is meant by one that a rule or `only` names: by its short name, or written as in the matrix."""
    if value.is_called(wanted):
        return True
    try:
        return any(one.identity == value.identity for one in values_of(value.key, wanted, folder, "", ""))
    except (InputError, TypeError):  # as a pattern it matches no file
        return False


def _known_values(axis: Axis, wanted: Any) -> str:
    labels = [value.label for value in axis.values]
    shown = ", ".join(labels[:MOST_TOLD]) + (", …" if len(labels) > MOST_TOLD else "")
    return f"{did_you_mean(str(wanted), labels)}{axis.key} has {shown}"


def _selection(only: Sequence[str], keys: Sequence[str]) -> dict[str, list[Any]]:
    """Values that `only` names for each key; InputError if a key is in no job."""
    selected: dict[str, list[Any]] = {}
    for text in only:
        parts, value = parse_override(text)
        key = ".".join(parts)
        if key not in (*keys, NAME_KEY):
            fix = did_you_mean(key, keys) or f"keys are {', '.join(keys)} and {NAME_KEY}"
            raise InputError(f"no job has the key '{key}'", where="only", fix=fix.strip())
        selected.setdefault(key, []).append(str(value) if key == NAME_KEY else value)
    return selected


def _check_overrides(keys: set[str], axes: Sequence[Axis]) -> None:
    """Refuse an override of what the matrix sets in every job: it would be lost without a word."""
    for key in sorted(keys):
        for axis in axes:
            if key == axis.key or key.startswith(f"{axis.key}.") or axis.key.startswith(f"{key}."):
                fix = f"select with --only {axis.key}=…, or change the matrix"
                raise InputError(f"'{key}' is set by the matrix ({axis.key})", where="overrides", fix=fix)


def _value_at(settings: Mapping[str, Any], key: str) -> Any:
    """Value of a dotted key in the tables of a config; "none" where it is not set."""
    found: Any = settings
    for part in key.split("."):
        found = found.get(part) if isinstance(found, Mapping) else None
    return "none" if found is None else found


def all_of(mistakes: Sequence[str]) -> str:
    """One line with the mistakes, at most `MOST_TOLD` of them."""
    more = f"; and {len(mistakes) - MOST_TOLD} more mistakes" if len(mistakes) > MOST_TOLD else ""
    return "; ".join(mistakes[:MOST_TOLD]) + more
