"""The batch file: TOML, validated by pydantic. What its matrix means is in `rsibr.batches.matrix`.

Each error is one line that names the file, the key, the value and the allowed values or the nearest known key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from rsibr.batches.job import Then
from rsibr.errors import InputError
from rsibr.scene.config import read_toml
from rsibr.scene.config_errors import describe


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def _name_or_table(value: Any) -> Any:
    if not isinstance(value, str | dict):
        raise ValueError("should be the path of a config, in quotes, or a table")
    return value


def _matrix(value: dict[str, Any]) -> dict[str, Any]:
    for key, values in value.items():
        if not isinstance(values, list):
            raise ValueError(f"{key} should be a list, in brackets")
        if not values:
            raise ValueError(f"{key} should hold at least one value")
    return value


def _rule(value: dict[str, Any]) -> dict[str, Any]:
    if not value:
        raise ValueError("should name at least one key")
    return value


NameOrTable = Annotated[Any, AfterValidator(_name_or_table)]
Matrix = Annotated[dict[str, Any], AfterValidator(_matrix)]
Rule = Annotated[dict[str, Any], AfterValidator(_rule)]
_T = TypeVar("_T")
Listed = Annotated[tuple[_T, ...], Field(strict=False)]


class ValidateConfig(_Section):
    """Options of `rsibr.validate`, which follows each bake.

    Attributes
    ----------
    views : int
        Novel views.
    samples : int, optional
        Samples a texel of each reference; by default those of `rsibr validate`.
    methods : list of str, optional
        Names of methods; by default all whose requirements the bake meets.
    lobes : bool, optional
        Whether errors of single lobes are measured too; by default as in `rsibr.validate`.
    """

    views: int = Field(default=8, ge=1, le=10_000)
    samples: int | None = Field(default=None, ge=8, le=2**24)
    methods: Listed[str] | None = None
    lobes: bool | None = None


class ThenConfig(_Section):
    """Steps after each bake.

    Attributes
    ----------
    validate_ : ValidateConfig, optional
        Key `validate`: the bake is compared with path-traced references.
    publish : list of str
        Formats that it is published in, see `rsibr publish`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, validate_by_name=False)

    validate_: ValidateConfig | None = Field(default=None, alias="validate")
    publish: Listed[str] = ()

    def steps(self) -> Then:
        """Return the steps as plain data."""
        asked = self.validate_
        return Then(None if asked is None else asked.model_dump(mode="json", exclude_none=True), self.publish)


class RunConfig(_Section):
    """Where the jobs run.

    Attributes
    ----------
    executor : str
        Name of an executor: "serial", "processes" or "dask".
    threads : int
        Threads of a worker. One is the most economical, as long as there are as many jobs as cores.
    workers : int, optional
        Workers of this machine; by default as many as its cores allow. Workers of a cluster are its scheduler's.
    scheduler : str, optional
        Address of a Dask scheduler, as "tcp://node:8786"; by default a cluster on this machine.
    """

    executor: str = "processes"
    threads: int = Field(default=1, ge=1, le=1024)
    workers: int | None = Field(default=None, ge=1, le=100_000)
    scheduler: str | None = None

    def changed(self, *, executor: str | None = None, scheduler: str | None = None) -> RunConfig:
        """Return the config with another executor or scheduler, where given; a scheduler means Dask."""
        if scheduler is not None and executor is None:
            executor = "dask"
        given = {"executor": executor, "scheduler": scheduler}
        return self.model_copy(update={name: value for name, value in given.items() if value is not None})


class BatchFile(_Section):
    """Tables of a batch file.

    Attributes
    ----------
    base : str or table
        Path of a config, relative to the batch file, or a config's tables.
    name : str, optional
        Name of a job, with `{key}` in place of the value of a key; by default `{key}` of all keys of the matrix,
        separated by "/".
    matrix : table
        Keys of the config, each with a list of values: the jobs are all their combinations. `material` and
        `environment` take short forms, see `rsibr.batches.values`.
    exclude : list of table
        Combinations that are left out: those that have all the values of a rule.
    include : list of table
        Jobs that are added: the base with these values.
    then : ThenConfig
    run : RunConfig
    """

    base: NameOrTable
    name: str | None = None
    matrix: Matrix = Field(default_factory=dict)
    exclude: Listed[Rule] = ()
    include: Listed[Rule] = ()
    then: ThenConfig = ThenConfig()
    run: RunConfig = RunConfig()


@dataclass(frozen=True)
class BatchConfig:
    """Batch file, read and checked by itself.

    Attributes
    ----------
    tables : BatchFile
        What it holds.
    folder : Path
        Folder at which its relative paths start.
    where : str
        What an error names.
    title : str
        What the batch is called: the stem of the file.
    file : Path or None
        The file, for the command that repeats a job; None if the batch was given as tables.
    """

    tables: BatchFile
    folder: Path
    where: str
    title: str
    file: Path | None = None


def load_batch(path: Path | str) -> BatchConfig:
    """Read a batch file.

    Raises
    ------
    InputError
        If the file cannot be read, or a key or value in it is wrong. What its values name is checked by
        `rsibr.batches.matrix.Matrix.of`.
    """
    path = Path(path)
    tables = _checked(read_toml(path), str(path))
    return BatchConfig(tables, path.resolve().parent, str(path), path.stem, path)


def parse_batch(data: Mapping[str, Any], base: Path | str = ".", *, where: str = "batch") -> BatchConfig:
    """Check a batch given as a mapping; relative paths in it start at `base`. See `load_batch`."""
    return BatchConfig(_checked(data, where), Path(base).resolve(), where, "batch")


def _checked(data: Mapping[str, Any], where: str) -> BatchFile:
    try:
        return BatchFile.model_validate(dict(data))
    except ValidationError as error:
        problems = "; ".join(describe(error, BatchFile)).replace("a valid tuple", "a list, in brackets")
        raise InputError(problems, where=where) from None


def base_tables(config: BatchConfig) -> tuple[dict[str, Any], Path, str]:
    """Tables of the base config, the folder at which its paths start, and what an error names."""
    base = config.tables.base
    if isinstance(base, dict):
        return base, config.folder, f"{config.where}, base"
    path = config.folder / Path(base).expanduser()
    if not path.is_file():
        raise InputError(f"base = {base!r}: there is no such config", where=config.where, fix="check the path")
    return read_toml(path), path.resolve().parent, str(path)


def section_keys(rules: Sequence[Mapping[str, Any]]) -> dict[str, None]:
    """All keys of some tables, in the order in which they first stand there."""
    return {key: None for rule in rules for key in rule}
