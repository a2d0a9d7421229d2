"""The config of a study: what is varied about a base config, in which scenes, and how it is judged; TOML."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from rsibr.errors import InputError
from rsibr.reconstruct.mesh import DiskMesh
from rsibr.reconstruct.methods import METHODS
from rsibr.scene.config import Config, load_config, parse_config, read_toml
from rsibr.scene.config_errors import describe
from rsibr.validate.reference import MINIMUM_BUFFERS

PER_TEXEL = "texel"

_MESH = re.compile(r"mesh-([1-9]\d{0,2})x([1-9]\d{0,3})")


def mesh_of(warp: str) -> DiskMesh | None:
    """Tessellation that the warp `mesh-RxS` names, R rings and S sectors; None for any other name."""
    found = _MESH.fullmatch(warp)
    return DiskMesh(int(found[1]), int(found[2])) if found is not None and int(found[2]) >= 3 else None


def _method(name: str) -> str:
    if name not in METHODS:
        near = difflib.get_close_matches(name, METHODS, 1)
        meant = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(f"is no method: {meant}there are {', '.join(METHODS)}")
    return name


def _warp(name: str) -> str:
    if name != PER_TEXEL and mesh_of(name) is None:
        raise ValueError('should be "texel" or "mesh-RxS", as in "mesh-16x48", with at least 3 sectors S')
    return name


def _name_or_table(value: Any) -> Any:
    if not isinstance(value, str | dict):
        raise ValueError("should be a name, in quotes, or a table")
    return value


def _distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if not values:
        raise ValueError("should hold at least one value")
    twice = [value for index, value in enumerate(values) if value in values[:index]]
    if twice:
        raise ValueError(f"holds {twice[0]!r} twice")
    return values


def _three(values: tuple[int, ...]) -> tuple[int, ...]:
    if len(values) < 3:
        raise ValueError("should hold at least three values, to fit a slope")
    return values


_T = TypeVar("_T")
_Axis = Annotated[tuple[_T, ...], Field(strict=False), AfterValidator(_distinct)]
_NameOrTable = Annotated[Any, AfterValidator(_name_or_table)]
_Samples = Annotated[int, Field(ge=4, le=2**24)]
_Resolution = Annotated[int, Field(ge=8, le=4096)]
_Subdivision = Annotated[int, Field(ge=0, le=5)]
_Method = Annotated[str, AfterValidator(_method)]
_Warp = Annotated[str, AfterValidator(_warp)]
_Weights = Literal["own", "area", "gnomonic"]
_Precision = Literal["float32", "float16"]


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class SweepConfig(_Section):
    """One grid: every combination of the values given. What is not given stays as the base config has it.

    Attributes
    ----------
    samples, resolution, subdivision : list of int
        Of the bake: samples a texel, texels a side, 0 to 5 for 12, 42, 162, 642 … stored views.
    method : list of str
        Names from `METHODS`; by default those of the study.
    warp : list of "texel" or "mesh-RxS"
        Each texel by itself, or through a tessellated disk of R rings and S sectors. Only `cabral1999` has the choice.
    weights : list of "own", "area" or "gnomonic"
        Of the three stored views; "own" are the method's. `nearest` has none.
    precision : list of "float32" or "float16"
        What the maps are held in.
    """

    samples: _Axis[_Samples] | None = None
    resolution: _Axis[_Resolution] | None = None
    subdivision: _Axis[_Subdivision] | None = None
    method: _Axis[_Method] | None = None
    warp: _Axis[_Warp] = (PER_TEXEL,)
    weights: _Axis[_Weights] = ("own",)
    precision: _Axis[_Precision] = ("float32",)


class ScenesConfig(_Section):
    """The scenes: each material under each environment.

    Attributes
    ----------
    material : list of str or table
        Presets, or tables as `[material]` of a config. By default the base config's.
    environment : list of str or table
        Files, or tables as `[environment]` of a config. By default the base config's.
    """

    material: _Axis[_NameOrTable] | None = None
    environment: _Axis[_NameOrTable] | None = None


class JudgeConfig(_Section):
    """How the points are judged, all of them alike.

    Attributes
    ----------
    views : int
        Novel views: half at triangle centroids of the icosahedron, which are triangle centroids at every subdivision,
        half random.
    resolution : int, optional
        Texels a side of the pictures that are compared; by default the finest resolution of the stored maps.
    samples : int
        Samples a texel of each reference.
    repeats : int
        Timed runs of each picture, after a first one that compiles and does not count.
    frames : int
        Pictures that the whole job is taken to make, where baking and making pictures are added up.
    """

    views: int = Field(default=6, ge=1, le=1000)
    resolution: _Resolution | None = None
    samples: int = Field(default=1024, ge=MINIMUM_BUFFERS, le=2**24)
    repeats: int = Field(default=5, ge=3, le=1000)
    frames: int = Field(default=100, ge=1, le=10**9)


class PathTracingConfig(_Section):
    """Path tracing as a rival, in two forms.

    Attributes
    ----------
    samples : list of int
        Samples a texel of its pictures, at least three, to fit its slope. Squares are stratified best.
    pass_samples : int
        Samples of a pass of the progressive form, whose passes share no strata: its error falls as that of independent
        samples. The other form stratifies all samples of a picture among each other, and is the rival.
    """

    samples: Annotated[_Axis[_Samples], AfterValidator(_three)] = (64, 256, 576, 1024)
    pass_samples: _Samples = 64


class _File(_Section):
    """The tables of the file, those of other models not yet looked into."""

    base: _NameOrTable
    scenes: ScenesConfig = ScenesConfig()
    method: _Axis[_Method] = ("cabral1999", "rsibr")
    sweep: _Axis[dict[str, Any]]
    judge: JudgeConfig = JudgeConfig()
    path_tracing: PathTracingConfig = PathTracingConfig()


class StudyConfig(_Section):
    """Everything that a study depends on. Built by `load_study` or `parse_study`.

    Attributes
    ----------
    name : str
        What it is called in the report.
    scenes : tuple of Config
        A whole config for each material under each environment, with the base's size and samples.
    method : tuple of str
        Methods of the sweeps that name none.
    sweep : tuple of SweepConfig
        The study is the union of these grids.
    judge : JudgeConfig
    path_tracing : PathTracingConfig
    """

    name: str
    scenes: tuple[Config, ...]
    method: tuple[str, ...]
    sweep: tuple[SweepConfig, ...]
    judge: JudgeConfig
    path_tracing: PathTracingConfig


def load_study(path: Path) -> StudyConfig:
    """Read the config of a study from a TOML file; relative paths in it start at its folder.

    Raises
    ------
    InputError
        If the file cannot be read, or a key or value in it is wrong.
    """
    path = Path(path)
    return parse_study(read_toml(path), path.resolve().parent, name=path.stem, where=str(path))


def parse_study(
    data: Mapping[str, Any], base: Path | str = ".", *, name: str = "study", where: str = "study"
) -> StudyConfig:
    """Check the config of a study that is already a mapping; see `load_study`.

    Parameters
    ----------
    data : mapping
        The tables of the file.
    base : path
        Folder at which relative paths start.
    name : str
        What the study is called.
    where : str
        What an error names as the place.

    Raises
    ------
    InputError
        If a key or value is wrong; all wrong keys of a table are named at once.
    """
    folder = Path(base).resolve()
    file = _checked(_File, data, where)
    sweeps = tuple(_checked(SweepConfig, table, where, f"sweep[{k}]: ") for k, table in enumerate(file.sweep, 1))
    scenes = tuple(_scenes(file, folder, where))
    return StudyConfig(
        name=name, scenes=scenes, method=file.method, sweep=sweeps, judge=file.judge, path_tracing=file.path_tracing
    )


_Model = TypeVar("_Model", bound=BaseModel)


def _checked(model: type[_Model], data: Mapping[str, Any], where: str, prefix: str = "") -> _Model:
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        problems = "; ".join(describe(error, model)).replace("a valid tuple", "a list, in brackets")
        raise InputError(prefix + problems, where=where) from None


def _scenes(file: _File, folder: Path, where: str) -> Sequence[Config]:
    """A config for each material under each environment."""
    tables, start = _base_tables(file.base, folder, where)
    environments = [{"environment": _at(folder, table)} for table in _tables(file.scenes.environment, "file")]
    materials = [{"material": _at(folder, table)} for table in _tables(file.scenes.material, "preset")]
    return [
        parse_config({**tables, **environment, **material}, start, where=f"{where}, base")
        for environment in environments or [{}]
        for material in materials or [{}]
    ]


def _base_tables(base: str | dict[str, Any], folder: Path, where: str) -> tuple[dict[str, Any], Path]:
    """Tables of the base config, and the folder at which its own paths start."""
    if isinstance(base, dict):
        return base, folder
    path = folder / base
    if not path.is_file():
        raise InputError(f"base = {base!r}: there is no such config", where=where, fix="check the path")
    load_config(path)  # its mistakes are its own, and named as such
    return read_toml(path), path.parent


def _tables(values: tuple[Any, ...] | None, key: str) -> list[dict[str, Any]]:
    return [{key: value} if isinstance(value, str) else value for value in values or ()]


def _at(folder: Path, table: dict[str, Any]) -> dict[str, Any]:
    """Make the path of a scene absolute: it is relative to the study, not to its base config."""
    return {**table, "file": str(folder / table["file"])} if isinstance(table.get("file"), str) else table
