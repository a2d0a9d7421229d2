"""Results that are a table: as a CSV file, and as a data frame of pandas where that is installed."""

from __future__ import annotations

import importlib
import io
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

from rsibr.errors import MachineError
from rsibr.store.atomic import write_atomic


class Tabular(ABC):
    """Base of results with a table."""

    @abstractmethod
    def csv(self) -> str:
        """Text of the table: a heading, and a row a record."""

    def to_csv(self, path: Path | str) -> None:
        """Write the table, atomically.

        Raises
        ------
        BakeError, MachineError
            If it cannot be written.
        """
        write_atomic(Path(path), self.csv().encode())

    def to_dataframe(self) -> Any:
        """Table as a data frame; cells without a value are NaN.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        MachineError
            If pandas is not installed.
        """
        try:
            pandas = importlib.import_module("pandas")  # an extra, and slow to import
        except ImportError:
            fix = "`pip install 'rsibr[tables]'`, or use to_csv"
            raise MachineError("pandas is not installed", where="to_dataframe", fix=fix) from None
        return pandas.read_csv(io.StringIO(self.csv()))
