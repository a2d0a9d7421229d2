"""CSV of results: a heading, and a row a record."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def csv_table(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Text of a table; cells that a row does not have stay empty.

    Raises
    ------
    ValueError
        If a row has a cell of another column.

    Examples
    --------
    >>> csv_table(["a", "b"], [{"a": 1}, {"a": 2, "b": 3}]).splitlines()
    ['a,b', '1,', '2,3']
    """
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()
