"""Loading of environments and materials, each once for all scenes that name it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any, TypeVar

from rsibr.scene.config import Config, EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import Environment, load_environment
from rsibr.scene.material import Material, load_material
from rsibr.scene.python_plugins import load_plugins

_Part = TypeVar("_Part", EnvironmentConfig, MaterialConfig)
_Loaded = TypeVar("_Loaded")


class Loader:
    """Loads and checks the environment and the material of configs; those that are named again are shared."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[Any, float]] = {}

    def load(self, config: Config) -> tuple[Environment, Material, float]:
        """Load the environment and the material of a config.

        Returns
        -------
        environment : Environment
        material : Material
        seconds : float
            Time that it takes to load both, whoever loaded them first [s].

        Raises
        ------
        InputError
            If either is invalid.
        """
        load_plugins(config.plugin_modules)
        environment, of_environment = self._once(config.environment, load_environment)
        material, of_material = self._once(config.material, load_material)
        return environment, material, of_environment + of_material

    def _once(self, part: _Part, load: Callable[[_Part], _Loaded]) -> tuple[_Loaded, float]:
        key = json.dumps([type(part).__name__, part.model_dump(mode="json")])
        if key not in self._known:
            start = time.perf_counter()
            loaded = load(part)
            self._known[key] = loaded, max(0.0, time.perf_counter() - start)
        found: tuple[_Loaded, float] = self._known[key]
        return found
