"""Config of a comparison: bake configs, one scene each, or a file of environments × materials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rsibr.errors import InputError
from rsibr.methods.registry import baseline_method
from rsibr.scene.config import read_toml
from rsibr.scene.config_errors import describe
from rsibr.studies.axes import Axis, MethodName, NameOrTable, Resolution, Subdivision
from rsibr.studies.config import ScenesConfig, StudyConfig, parse_study
from rsibr.validation.reference import MINIMUM_BUFFERS

_BAKE_TABLES = ("environment", "material")
"""Tables that a bake config has and a comparison does not."""


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class CompareJudgeConfig(_Section):
    """How errors are measured.

    Attributes
    ----------
    views : int
        Novel views, the same for all systems: half at triangle centroids of the icosahedron, half random. The first
        one is shown.
    resolution : int, optional
        Texels a side of the maps that are compared; by default that of the stored maps.
    samples : int
        Samples a texel of each reference.
    keep_bakes : bool
        Whether bakes stay on the disk once all systems that read them are measured.
    """

    views: int = Field(default=4, ge=1, le=1000)
    resolution: Resolution | None = None
    samples: int = Field(default=1024, ge=MINIMUM_BUFFERS, le=2**24)
    keep_bakes: bool = True


class _File(_Section):
    """Tables of a comparison file; those of other models are validated later."""

    base: NameOrTable = Field(default_factory=dict)
    scenes: ScenesConfig = ScenesConfig()
    method: Axis[MethodName] | None = None
    subdivision: Axis[Subdivision] | None = None
    settings: Axis[MethodName] | None = None
    judge: CompareJudgeConfig = CompareJudgeConfig()


class CompareConfig(_Section):
    """One CONFIG of a comparison. Built by `load_compare` or `parse_compare`.

    Attributes
    ----------
    study : StudyConfig
        Scenes, sizes of bakes and judging: a study whose sweep is that of the stored views.
    method : tuple of str, optional
        Methods to compare, `NAME` or `NAME,OPTION=VALUE`; by default all.
    settings : tuple of str
        Further settings of these methods, `NAME,OPTION=VALUE`.
    """

    study: StudyConfig
    method: tuple[str, ...] | None = None
    settings: tuple[str, ...] = ()

    def with_plugins(self, modules: Sequence[str]) -> CompareConfig:
        """Return the config with these modules in every scene; see `rsibr.scene.plugins_config`."""
        return self.model_copy(update={"study": self.study.with_plugins(modules)})

    def judged_with(self, *, views: int | None = None, samples: int | None = None) -> CompareConfig:
        """Return the config with another number of views or of samples a texel of references, where given."""
        changed = {"views": views, "samples": samples}
        judge = self.study.judge.model_copy(update={key: n for key, n in changed.items() if n is not None})
        return self.model_copy(update={"study": self.study.model_copy(update={"judge": judge})})


def load_compare(path: Path) -> CompareConfig:
    """Read a CONFIG: a bake config is one scene, with the defaults of a comparison.

    Raises
    ------
    InputError
        If the file cannot be read, or a key or value in it is wrong.
    """
    path = Path(path)
    tables = read_toml(path)
    if any(name in tables for name in _BAKE_TABLES):
        tables = {"base": path.name}
    return parse_compare(tables, path.resolve().parent, name=path.stem, where=str(path))


def parse_compare(
    data: Mapping[str, Any], base: Path | str = ".", *, name: str = "comparison", where: str = "comparison"
) -> CompareConfig:
    """Validate the config of a comparison given as a mapping; see `load_compare`.

    Parameters
    ----------
    data : mapping
        The tables of the file.
    base : path
        Folder at which relative paths start.
    name : str
        Name of the comparison.
    where : str
        Name of the file in errors.
    """
    file = _checked(data, where)
    scenes = {key: data["scenes"][key] for key in ("material", "environment") if key in data.get("scenes", {})}
    sweep = {"method": [baseline_method()]} | ({"subdivision": list(file.subdivision)} if file.subdivision else {})
    judge = file.judge.model_dump(exclude_none=True) | {"errors_only": True}
    study = parse_study(
        {"base": file.base, "scenes": scenes, "sweep": [sweep], "judge": judge}, base, name=name, where=where
    )
    return CompareConfig(study=study, method=file.method, settings=file.settings or ())


def _checked(data: Mapping[str, Any], where: str) -> _File:
    try:
        return _File.model_validate(dict(data))
    except ValidationError as error:
        problems = "; ".join(describe(error, _File)).replace("a valid tuple", "a list, in brackets")
        raise InputError(problems, where=where) from None
