"""Job of a batch: one bake, with all that a process anywhere needs to run it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

BAKE_SUFFIX = ".rsibr"
"""Ending of the directory of a bake."""

RESULTS_NAME = "results"
"""Folder of the results in the directory of a batch."""


@dataclass(frozen=True)
class Then:
    """Steps after a bake.

    Attributes
    ----------
    validate : mapping, optional
        Options of `rsibr.validate`, such as `{"views": 4}`; None: not validated.
    publish : tuple of str
        Formats of `rsibr publish`.
    """

    validate: Mapping[str, Any] | None = None
    publish: tuple[str, ...] = ()

    def to_record(self) -> dict[str, Any]:
        """Return the steps as JSON data; `from_record` reads them back."""
        return {"validate": None if self.validate is None else dict(self.validate), "publish": list(self.publish)}

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Self:
        """Read the steps from the data that `to_record` returns."""
        return cls(validate=record["validate"], publish=tuple(record["publish"]))


@dataclass(frozen=True)
class Job:
    """One bake of a batch. Plain data: pickled, sent to another machine, written as JSON.

    Attributes
    ----------
    name : str
        Unique in the batch; a relative path whose parts are separated by "/", such as "solid-red/city-256".
    values : mapping
        Value of each key of the matrix; of files and tables their short name: `{"material": "solid-red",
        "environment": "noon", "map.resolution": 256}`.
    settings : mapping
        Tables of the config with absolute paths: `rsibr.scene.config.parse_config(settings, Path())`.
    then : Then
        Steps after the bake.
    digest : str
        SHA-256 of `settings`; the content of the files that they name is not part of it.
    """

    name: str
    values: Mapping[str, Any]
    settings: Mapping[str, Any]
    then: Then = Then()
    digest: str = field(default="")

    def __post_init__(self) -> None:
        if not self.digest:
            object.__setattr__(self, "digest", settings_digest(self.settings))

    @property
    def bake(self) -> str:
        """Path of the bake, relative to the directory of the batch."""
        return f"{self.name}{BAKE_SUFFIX}"

    @property
    def result(self) -> str:
        """Path of the result, relative to the directory of the batch."""
        return result_path(self.name)

    def to_record(self) -> dict[str, Any]:
        """Return the job as JSON data; `from_record` reads it back to an equal job."""
        return {
            "name": self.name,
            "values": dict(self.values),
            "settings": dict(self.settings),
            "then": self.then.to_record(),
            "digest": self.digest,
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Self:
        """Read a job from the data that `to_record` returns."""
        return cls(**{**record, "then": Then.from_record(record["then"])})


def result_path(name: str) -> str:
    """Path of the result of the job `name`, relative to the directory of the batch."""
    return f"{RESULTS_NAME}/{name}.json"


def settings_digest(settings: Mapping[str, Any]) -> str:
    """SHA-256 of the canonical JSON of a config's tables, in hexadecimal."""
    text = json.dumps(settings, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
