"""CSV of a study or a comparison; see `rsibr.store.csv_table`."""

from rsibr.store.csv_table import csv_table

__all__ = ["csv_table"]
