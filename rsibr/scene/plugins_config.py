"""Section `[plugins]` of a config: Python modules that register Mitsuba plugins."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from rsibr.scene.overrides import path_start


def _module(value: Any, info: ValidationInfo) -> str:
    """Check the name of a module, or make its path absolute; relative ones start as `path_start` says."""
    if isinstance(value, str) and all(part.isidentifier() for part in value.split(".")) and not value.endswith(".py"):
        return value
    if not isinstance(value, str) or not value.endswith(".py"):
        raise ValueError('should be the name of a module, as in "my_plugins", or its file, as in "my_plugins.py"')
    base = path_start(value, (info.context or {}).get("base", "."))
    try:
        return str((base / Path(value).expanduser()).resolve())
    except (RuntimeError, OSError) as error:
        raise ValueError(f"is no usable path: {error}") from None


class PluginsConfig(BaseModel):
    """Python modules that register Mitsuba plugins; see `rsibr.scene.python_plugins`.

    Attributes
    ----------
    modules : tuple of str
        Importable module names, or paths that end in `.py`. Imported in this order, before the scene is loaded.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    modules: Annotated[tuple[Annotated[str, BeforeValidator(_module)], ...], Field(strict=False)] = ()
