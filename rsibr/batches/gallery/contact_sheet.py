"""Arrangement of jobs by the keys of their matrix: rows, columns, groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar


class Valued(Protocol):
    """Anything with a value of each matrix key."""

    @property
    def values(self) -> Mapping[str, Any]:
        """Values by key."""


Entry = TypeVar("Entry", bound=Valued)


@dataclass(frozen=True)
class Sheet(Generic[Entry]):
    """Jobs that differ in the first two keys only.

    Attributes
    ----------
    title : str
        Values of all further keys; empty if there are none.
    columns : list of str
        Values of the second key.
    rows : dict of str to dict of str to list
        Jobs by value of the first key, then of the second; a cell has several if they differ in nothing named.
    """

    title: str
    columns: list[str]
    rows: dict[str, dict[str, list[Entry]]]


def matrix_keys(entries: Sequence[Valued]) -> list[str]:
    """All keys of the matrix, in order of appearance."""
    return list(dict.fromkeys(key for entry in entries for key in entry.values))


def contact_sheets(entries: Sequence[Entry]) -> list[Sheet[Entry]]:
    """Arrange jobs: the first key in rows, the second in columns, all further keys in sheets of their own.

    Parameters
    ----------
    entries : sequence
        Jobs in their order, which that of rows, columns and sheets follows.

    Returns
    -------
    list of Sheet
    """
    row_key, column_key, *further = (*matrix_keys(entries), "", "")
    further = [key for key in further if key]
    sheets: dict[str, Sheet[Entry]] = {}
    for entry in entries:
        title = ", ".join(f"{key} {shown(entry.values.get(key))}" for key in further)
        sheet = sheets.setdefault(title, Sheet(title, [], {}))
        row, column = shown(entry.values.get(row_key)), shown(entry.values.get(column_key))
        if column not in sheet.columns:
            sheet.columns.append(column)
        sheet.rows.setdefault(row, {}).setdefault(column, []).append(entry)
    return list(sheets.values())


def shown(value: Any) -> str:
    """Value of a key as text: tables and lists in one line, a dash for none."""
    if value is None:
        return "–"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {shown(one)}" for key, one in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(shown, value))
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
