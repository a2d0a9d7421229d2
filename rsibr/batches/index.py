"""Index of a batch: a row a job, as SQLite, CSV and, with pandas and pyarrow, Parquet; made from the result files.

The result files are the truth: an index that is lost or damaged is made anew from them (`rsibr batch --reindex`).
"""

from __future__ import annotations

import io
import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from rsibr.batches.result import JobResult
from rsibr.store.atomic import write_atomic
from rsibr.store.csv_table import csv_table

INDEX_NAMES = ("index.sqlite", "index.csv", "index.parquet")

TABLE = "jobs"
"""Table of the SQLite file."""

COLUMNS = {
    "name": "TEXT PRIMARY KEY",
    "state": "TEXT",
    "reason": "TEXT",
    "signal": "TEXT",
    "exit_code": "INTEGER",
    "bake": "TEXT",
    "digest": "TEXT",
    "seconds": "REAL",
    "processor_seconds": "REAL",
    "bytes": "INTEGER",
    "views": "INTEGER",
    "error": "REAL",
    "noise": "REAL",
    "worker": "TEXT",
    "attempts": "INTEGER",
    "finished_at": "TEXT",
}
"""Columns with their types; one for each key of the matrix stands behind the name, see `value_columns`."""


@dataclass(frozen=True)
class Index:
    """What an index was made from.

    Attributes
    ----------
    files : tuple of Path
        Written files.
    done, failed : int
        Numbers of results.
    damaged : tuple of Path
        Files that are no results, which were left out.
    seconds : float
        Processor time of the jobs that are done [s].
    bytes : int
        Size of their bakes.
    """

    files: tuple[Path, ...]
    done: int
    failed: int
    damaged: tuple[Path, ...]
    seconds: float
    bytes: int


def write_index(out: Path, results: Sequence[JobResult], damaged: Sequence[Path] = ()) -> Index:
    """Write the index of the batch in `out`.

    Parameters
    ----------
    out : Path
        Directory of the batch.
    results : sequence of JobResult
        Results, in the order of the rows.
    damaged : sequence of Path
        Files that are no results.

    Raises
    ------
    MachineError, BakeError
        If a file cannot be written.
    """
    keys = value_columns(results)
    rows = [_row(result, keys) for result in results]
    columns = ["name", *keys.values(), *list(COLUMNS)[1:]]
    files = [_write(out / "index.sqlite", _sqlite(columns, rows)), _write(out / "index.csv", _csv(columns, rows))]
    if (table := _parquet(columns, rows)) is not None:
        files.append(_write(out / "index.parquet", table))
    done = [result for result in results if result.state == "done"]
    return Index(
        files=tuple(files),
        done=len(done),
        failed=len(results) - len(done),
        damaged=tuple(damaged),
        seconds=sum(result.processor_seconds for result in done),
        bytes=sum(result.bytes for result in done),
    )


def value_columns(results: Sequence[JobResult]) -> dict[str, str]:
    """Column of each key of the matrix: its own name, or `value_KEY` where a column of another meaning has it."""
    keys = dict.fromkeys(key for result in results for key in result.values)
    return {key: f"value_{key}" if key.casefold() in COLUMNS else key for key in keys}


def rows_of(index: Path) -> Iterator[dict[str, Any]]:
    """Rows of an `index.sqlite`, by name."""
    with closing(sqlite3.connect(f"{index.resolve().as_uri()}?mode=ro", uri=True)) as connection:
        connection.row_factory = sqlite3.Row
        yield from (dict(row) for row in connection.execute(f"SELECT * FROM {TABLE} ORDER BY name"))


def _row(result: JobResult, keys: Mapping[str, str]) -> dict[str, Any]:
    values = {column: _cell(result.values.get(key)) for key, column in keys.items()}
    return {**values, **{name: getattr(result, name) for name in COLUMNS}}


def _cell(value: Any) -> Any:
    """Number or text of a value of the matrix; SQLite has no truth values."""
    if isinstance(value, bool):
        return str(value).lower()
    return value if value is None or isinstance(value, int | float | str) else json.dumps(value)


def _sqlite(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Bytes of the file. It is made in memory: SQLite's locks do not hold on every network's file system."""
    with closing(sqlite3.connect(":memory:")) as connection:
        declared = ", ".join(f"{_quoted(name)} {COLUMNS.get(name, '')}" for name in columns)
        connection.execute(f"CREATE TABLE {TABLE} ({declared})")
        places = ", ".join("?" * len(columns))
        connection.executemany(
            f"INSERT INTO {TABLE} VALUES ({places})", ([row[name] for name in columns] for row in rows)
        )
        connection.execute(f"CREATE INDEX by_state ON {TABLE} (state)")
        connection.commit()
        return bytes(connection.serialize())


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _csv(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> bytes:
    return csv_table(columns, rows).encode()


def _parquet(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> bytes | None:
    """Bytes of the file; None without pandas or pyarrow."""
    try:
        pd = import_module("pandas")  # of the extra `tables`, with pyarrow, by which it writes
        import_module("pyarrow")
    except ImportError:
        return None
    table = pd.DataFrame(rows, columns=list(columns))
    mixed = [name for name in columns if table[name].map(type).nunique() > 1 and name not in COLUMNS]
    table = table.astype(dict.fromkeys(mixed, "string")).convert_dtypes()  # a column of Parquet has one type
    stream = io.BytesIO()
    table.to_parquet(stream, index=False)
    return stream.getvalue()


def _write(path: Path, data: bytes) -> Path:
    write_atomic(path, data)
    return path
