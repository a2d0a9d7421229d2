"""Stored views of a config."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rsibr.errors import InputError
from rsibr.geometry.viewpoints import Viewpoints, from_directions, icosphere
from rsibr.regular_file import read_regular
from rsibr.scene.config import ViewsConfig


def load_viewpoints(config: ViewsConfig) -> Viewpoints:
    """Read directions and triangles from a file, or make the icosphere.

    Parameters
    ----------
    config : ViewsConfig
        Section of the config. Its `file`, if given, is JSON `{"directions": [[x, y, z], …], "triangles": [[i, j, k],
        …]}`; without triangles, those of the convex hull are used.

    Raises
    ------
    InputError
        If the file cannot be read or its views do not cover the sphere.
    """
    if config.file is None:
        return icosphere(config.level)
    content = _read_json(config.file)
    if not isinstance(content, dict) or "directions" not in content:
        raise InputError('no "directions" in it', where=str(config.file), fix='give {"directions": [[x, y, z], …]}')
    try:
        return from_directions(content["directions"], content.get("triangles"))
    except InputError as error:
        raise InputError(error.what, where=str(config.file), fix=error.fix) from None
    except OverflowError:
        raise InputError("holds a number that is too large", where=str(config.file)) from None


def _read_json(path: Path) -> Any:
    try:
        return json.loads(read_regular(path).decode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), fix="check views.file") from None
    except ValueError as error:
        raise InputError(f"is not JSON: {error}", where=str(path)) from None
    except RecursionError:
        raise InputError("is nested too deeply", where=str(path)) from None
