"""Path-traced references of a validation as map files, which the page of `rsibr view` shows and judges by."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from rsibr.errors import InputError
from rsibr.store.atomic import read_bytes, unwritable
from rsibr.store.directory import make_own_folder
from rsibr.store.map_file import MapFile, read_map, write_map
from rsibr.validation.results import Validation

REFERENCES_NAME = "references"
_PATTERN = "view_[0-9][0-9]*.exr"
_LARGEST_METRICS = 2**28


@dataclass(frozen=True, eq=False)
class StoredReferences:
    """References of a validation, read back.

    Attributes
    ----------
    config_hash : str
        Identity of the validated bake, `Manifest.config_hash`.
    labels : list of str
        Origin of each view.
    maps : list of MapFile
        Reference of each view, with the variance of its mean.
    """

    config_hash: str
    labels: list[str]
    maps: list[MapFile]


def write_references(validation: Validation, directory: Path) -> None:
    """Write the reference of each view to `references/view_01.exr` …, as a map with the variance of its mean.

    Parameters
    ----------
    validation : Validation
        Result of a validation.
    directory : Path
        Directory of the report; references of an earlier validation are removed.

    Raises
    ------
    BakeError, MachineError
        If it cannot be written.
    """
    folder = directory / REFERENCES_NAME
    names = {_name(number) for number in range(1, len(validation.views) + 1)}
    try:
        make_own_folder(folder)
        for stale in folder.glob(_PATTERN):
            if stale.name not in names:
                stale.unlink()
    except OSError as error:
        raise unwritable(folder, error) from error
    for number, view in enumerate(validation.views, 1):
        reference = view.reference
        layers = {"reference": reference.mean}
        direction = view.frame[:, 2].copy()
        written = MapFile(direction, view.frame, layers, reference.variance_of_mean, reference.coverage)
        write_map(folder / _name(number), written)


def read_references(directory: Path) -> StoredReferences:
    """Read the references of a validation from the directory of its report.

    Raises
    ------
    InputError
        If the directory holds no validation, or one without references.
    BakeError
        If a file is damaged.
    """
    folder, metrics = directory / REFERENCES_NAME, directory / "metrics.json"
    fix = "name the --out of `rsibr validate`; run it again if it was made by an earlier version"
    if not metrics.is_file() or not folder.is_dir():
        lacks = "metrics.json" if not metrics.is_file() else REFERENCES_NAME
        raise InputError(f"is no directory of a validation: it has no {lacks}", where=str(directory), fix=fix)
    try:
        told = json.loads(read_bytes(metrics, _LARGEST_METRICS))
        config_hash, labels = str(told["bake"]["details"]["config_hash"]), [str(one["label"]) for one in told["views"]]
    except (ValueError, KeyError, TypeError):
        raise InputError("is no metrics.json of a validation", where=str(metrics), fix=fix) from None
    maps = [read_map(folder / _name(number)) for number in range(1, len(labels) + 1)]
    return StoredReferences(config_hash, labels, maps)


def _name(number: int) -> str:
    return f"view_{number:02d}.exr"
