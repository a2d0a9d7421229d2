"""Types of the values that a study sweeps over, with their validation."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, Field

from rsibr.errors import InputError
from rsibr.methods.registry import registration
from rsibr.methods.warp_blend.disk_mesh import DiskMesh

PER_TEXEL = "texel"

_MESH = re.compile(r"mesh-([1-9]\d{0,2})x([1-9]\d{0,3})")


def mesh_of(warp: str) -> DiskMesh | None:
    """Tessellation that the warp `mesh-RxS` names, R rings and S sectors; None for any other name."""
    found = _MESH.fullmatch(warp)
    return DiskMesh(int(found[1]), int(found[2])) if found is not None and int(found[2]) >= 3 else None


def _method(name: str) -> str:
    try:
        return registration(name).name
    except InputError as error:
        raise ValueError(f"is no method: {error.fix}") from error


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


def at_least_three(values: tuple[int, ...]) -> tuple[int, ...]:
    """Require at least three values, so that a slope can be fitted."""
    if len(values) < 3:
        raise ValueError("should hold at least three values, to fit a slope")
    return values


_T = TypeVar("_T")
Axis = Annotated[tuple[_T, ...], Field(strict=False), AfterValidator(_distinct)]
NameOrTable = Annotated[Any, AfterValidator(_name_or_table)]
Title = Annotated[str, Field(min_length=1, max_length=80)]
Samples = Annotated[int, Field(ge=4, le=2**24)]
Resolution = Annotated[int, Field(ge=8, le=4096)]
Subdivision = Annotated[int, Field(ge=0, le=5)]
MethodName = Annotated[str, AfterValidator(_method)]
WarpName = Annotated[str, AfterValidator(_warp)]
WeightsName = Literal["own", "area", "gnomonic"]
PrecisionName = Literal["float32", "float16"]
