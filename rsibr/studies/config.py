"""Config of a study in TOML: base config, scenes, sweeps, references, path tracing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from rsibr.errors import InputError
from rsibr.methods.registry import baseline_method, default_method
from rsibr.scene.config import Config, load_config, parse_config, read_toml
from rsibr.scene.config_errors import describe
from rsibr.studies.axes import (
    PER_TEXEL,
    Axis,
    MethodName,
    NameOrTable,
    PrecisionName,
    Resolution,
    Samples,
    Subdivision,
    Title,
    WarpName,
    WeightsName,
    at_least_three,
)
from rsibr.validation.reference import MINIMUM_BUFFERS


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class SweepConfig(_Section):
    """One grid: all combinations of the given values. Other parameters are those of the base config.

    Attributes
    ----------
    samples, resolution, subdivision : list of int
        Of the bake: samples a texel, texels a side, 0 to 5 for 12, 42, 162, 642 … stored views.
    method : list of str
        Names of methods; by default those of the study.
    warp : list of "texel" or "mesh-RxS"
        Each texel by itself, or a tessellated disk of R rings and S sectors. Of methods with the option `mesh`.
    weights : list of "own", "area" or "gnomonic"
        Of the three stored views; "own" are the method's. Of methods with the option `weights`.
    precision : list of "float32" or "float16"
        What the maps are held in.
    """

    samples: Axis[Samples] | None = None
    resolution: Axis[Resolution] | None = None
    subdivision: Axis[Subdivision] | None = None
    method: Axis[MethodName] | None = None
    warp: Axis[WarpName] = (PER_TEXEL,)
    weights: Axis[WeightsName] = ("own",)
    precision: Axis[PrecisionName] = ("float32",)


class ScenesConfig(_Section):
    """Scenes: every material under every environment.

    Attributes
    ----------
    material : list of str or table
        Presets, or tables as `[material]` of a config, see also `MaterialTitle`. By default the base config's.
    environment : list of str or table
        Files, or tables as `[environment]` of a config. By default the base config's.
    """

    material: Axis[NameOrTable] | None = None
    environment: Axis[NameOrTable] | None = None


class MaterialTitle(_Section):
    """Keys that a table of `scenes.material` may have beside those of `[material]`.

    Attributes
    ----------
    name : str, optional
        What the material is called in the report; by default what it is made from.
    material_class : str, optional
        Key `class`: the family of materials whose errors are summed up together; by default the material's own name.
    """

    name: Title | None = None
    material_class: Title | None = Field(default=None, alias="class")


class SceneConfig(_Section):
    """A material under an environment.

    Attributes
    ----------
    config : Config
        The base config with this material and environment.
    title : MaterialTitle
        Of the material.
    """

    config: Config
    title: MaterialTitle = MaterialTitle()


class JudgeConfig(_Section):
    """How the error of all points is measured.

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
        Pictures of the whole job, where bake, preparation, compilation and pictures are added up.
    errors_only : bool
        Measure the error and the time of the pictures alone: no noise and bias, no `eval`, no lobes, no path tracing to
        compare with, hence no convergence and no fronts. For many scenes.
    keep_bakes : bool
        Whether bakes stay on the disk once all that is asked of them is measured.
    """

    views: int = Field(default=6, ge=1, le=1000)
    resolution: Resolution | None = None
    samples: int = Field(default=1024, ge=MINIMUM_BUFFERS, le=2**24)
    repeats: int = Field(default=5, ge=3, le=1000)
    frames: int = Field(default=100, ge=1, le=10**9)
    errors_only: bool = False
    keep_bakes: bool = True


class PathTracingConfig(_Section):
    """Path tracing for comparison, in two forms.

    Attributes
    ----------
    samples : list of int
        Samples a texel of its pictures, at least three, to fit its slope. Squares are stratified best.
    pass_samples : int
        Samples of a pass of the progressive form, whose passes share no strata: its error falls as that of independent
        samples. The other form stratifies all samples of a picture among each other, and is the rival.
    """

    samples: Annotated[Axis[Samples], AfterValidator(at_least_three)] = (64, 256, 576, 1024)
    pass_samples: Samples = 64


class _File(_Section):
    """Tables of the file; those of other models are validated later."""

    base: NameOrTable
    scenes: ScenesConfig = ScenesConfig()
    method: Axis[MethodName] = Field(default_factory=lambda: (baseline_method(), default_method()))
    sweep: Axis[dict[str, Any]]
    judge: JudgeConfig = JudgeConfig()
    path_tracing: PathTracingConfig = PathTracingConfig()


class StudyConfig(_Section):
    """Complete config of a study. Built by `load_study` or `parse_study`.

    Attributes
    ----------
    name : str
        What it is called in the report.
    scenes : tuple of SceneConfig
        Each material under each environment, with the base's size and samples.
    method : tuple of str
        Methods of the sweeps that name none.
    sweep : tuple of SweepConfig
        The study is the union of these grids.
    judge : JudgeConfig
    path_tracing : PathTracingConfig
    """

    name: str
    scenes: tuple[SceneConfig, ...]
    method: tuple[str, ...]
    sweep: tuple[SweepConfig, ...]
    judge: JudgeConfig
    path_tracing: PathTracingConfig

    def with_plugins(self, modules: Sequence[str]) -> StudyConfig:
        """Return the config with these modules in every scene; see `rsibr.scene.plugins_config`."""
        scenes = (one.model_copy(update={"config": one.config.with_plugins(modules)}) for one in self.scenes)
        return self.model_copy(update={"scenes": tuple(scenes)})

    @property
    def base(self) -> Config:
        """Config of the first scene: size, views and samples are those of all scenes."""
        return self.scenes[0].config


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
    """Validate the config of a study given as a mapping; see `load_study`.

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


def _scenes(file: _File, folder: Path, where: str) -> Sequence[SceneConfig]:
    """A config for each material under each environment."""
    tables, start = _base_tables(file.base, folder, where)
    environments = [{"environment": _at(folder, table)} for table in _tables(file.scenes.environment, "file")]
    rows = enumerate(_tables(file.scenes.material, "preset"), 1)
    titled = [_titled(table, f"{where}, scenes.material[{number}]") for number, table in rows]
    materials = [(title, {"material": _at(folder, table)}) for title, table in titled] or [(MaterialTitle(), {})]
    return [
        SceneConfig(config=parse_config({**tables, **sky, **material}, start, where=f"{where}, base"), title=title)
        for sky in environments or [{}]
        for title, material in materials
    ]


def _titled(table: dict[str, Any], where: str) -> tuple[MaterialTitle, dict[str, Any]]:
    """Take the title out of the table of a material."""
    own = {key: value for key, value in table.items() if key in ("name", "class")}
    rest = {key: value for key, value in table.items() if key not in own}
    return _checked(MaterialTitle, own, where), rest


def _base_tables(base: str | dict[str, Any], folder: Path, where: str) -> tuple[dict[str, Any], Path]:
    """Tables of the base config, and the folder at which its own paths start."""
    if isinstance(base, dict):
        return base, folder
    path = folder / base
    if not path.is_file():
        raise InputError(f"base = {base!r}: there is no such config", where=where, fix="check the path")
    load_config(path)  # reports mistakes in the base config itself
    return read_toml(path), path.parent


def _tables(values: tuple[Any, ...] | None, key: str) -> list[dict[str, Any]]:
    return [{key: value} if isinstance(value, str) else value for value in values or ()]


def _at(folder: Path, table: Mapping[str, Any]) -> dict[str, Any]:
    """Make the paths of a scene absolute: they are relative to the study, not to its base config."""
    return {key: _path_at(folder, key, value) for key, value in table.items()}


def _path_at(folder: Path, key: str, value: Any) -> Any:
    if isinstance(value, Mapping):
        return _at(folder, value)
    return str(folder / Path(value).expanduser()) if key in ("file", "filename") and isinstance(value, str) else value
