"""Curves in files: a CSV of encoded values and relative exposures."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from rsibr.capture.curves.curve import KNOTS, Curve
from rsibr.errors import InputError
from rsibr.regular_file import read_regular
from rsibr.store.atomic import write_atomic

_HEADER = "value,red,green,blue"


def read_curve(path: Path | str) -> Curve:
    """Read a curve.

    Parameters
    ----------
    path : path
        CSV with the header `value,red,green,blue`: encoded values that increase from 0 to 1, and the relative exposure
        of each channel, which increases strictly. Scaled so that 1 is saturation.

    Raises
    ------
    InputError
        If there is no such file, or it is no curve.
    """
    where = str(path)
    try:
        text = read_regular(Path(path)).decode()
        header, _, rows = text.partition("\n")
        table = np.loadtxt(io.StringIO(rows), delimiter=",", ndmin=2)
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise InputError(
            f"cannot be read as a curve: {error}", where=where, fix=f"give a CSV with {_HEADER}"
        ) from error
    if header.strip() != _HEADER or table.shape[1:] != (4,) or len(table) < 2:
        raise InputError("is no table of a curve", where=where, fix=f"begin it with the line {_HEADER}")
    values = table[:, 0]
    if not np.isfinite(table).all() or (np.diff(values) <= 0).any() or values[0] != 0 or values[-1] != 1:
        raise InputError("its values do not increase from 0 to 1", where=where, fix="sort its rows, from 0 to 1")
    at = np.linspace(0.0, 1.0, KNOTS)
    knots = np.stack([np.interp(at, values, table[:, k]) for k in (1, 2, 3)])
    return Curve(where, knots / knots[:, -1:])


def write_curve(path: Path | str, curve: Curve) -> None:
    """Write a curve as CSV, atomically; `read_curve` reads it."""
    at = np.linspace(0.0, 1.0, curve.knots.shape[1])
    rows = [",".join(f"{value:.9g}" for value in row) for row in np.column_stack([at, curve.knots.T])]
    write_atomic(Path(path), "\n".join([_HEADER, *rows, ""]).encode())
