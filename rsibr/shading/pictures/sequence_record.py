"""Record beside the frames of a sequence: how each was made, so that a later run keeps it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rsibr.store.atomic import write_atomic

_KEYS = ("made_by", "sha256")


@dataclass(frozen=True)
class SequenceRecord:
    """What earlier runs made.

    Attributes
    ----------
    frames : dict of str to dict
        By file name: `made_by`, digest of all that decides the frame, and `sha256` of the file.
    exposure : float or None
        Factor on radiance that was chosen for all frames.
    exposed_by : str
        Digest of all that decided the exposure; empty if none was chosen.
    film : dict or None
        `made_by`, digest of the frames, and `sha256` of the film.
    """

    frames: Mapping[str, dict[str, str]] = field(default_factory=dict)
    exposure: float | None = None
    exposed_by: str = ""
    film: dict[str, str] | None = None


def read_record(sidecar: Path) -> SequenceRecord:
    """Record of an earlier run; an empty one if there is none, or the file is no record."""
    try:
        found = json.loads(sidecar.read_bytes())
        frames = {str(name): _entry(entry) for name, entry in found["frames"].items()}
        film, exposure = found.get("film"), found.get("exposure")
        exposure = float(exposure) if exposure is not None and 0 < float(exposure) < math.inf else None
        return SequenceRecord(
            frames, exposure, str(found.get("exposed_by", "")), None if film is None else _entry(film)
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
        return SequenceRecord()


def write_record(sidecar: Path, record: SequenceRecord) -> None:
    """Write a record, atomically."""
    write_atomic(sidecar, json.dumps({"schema": 1, **asdict(record)}, indent=1).encode())


def _entry(found: Mapping[str, Any]) -> dict[str, str]:
    return {key: str(found[key]) for key in _KEYS}
