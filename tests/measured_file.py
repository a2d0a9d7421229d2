"""The script that writes the synthetic file of the plugin `measured`, which is no part of the package."""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path
from types import ModuleType

SCRIPT = Path(__file__).parents[1] / "scripts" / "measured_bsdf.py"


@cache
def load() -> ModuleType:
    specification = importlib.util.spec_from_file_location("measured_bsdf", SCRIPT)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module
