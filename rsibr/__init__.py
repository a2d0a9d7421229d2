"""rsibr: reflection-space image based rendering on Mitsuba 3, with measured error.

Bake a material under a distant environment into a few radiance sphere maps, reconstruct the map of any other view from
them, and compare it with a path-traced reference:

>>> import rsibr
>>> bake = rsibr.bake("configs/demo.toml", out="out/paint.rsibr")           # doctest: +SKIP
>>> paint = rsibr.reconstruct(bake, view=(1, 2, 3), method="rsibr")    # doctest: +SKIP
>>> report = rsibr.validate(bake, views=8, out="out/report")                # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rsibr.budget.bake import bake as bake
    from rsibr.budget.bake import plan as plan
    from rsibr.methods.method_set import MethodSet as MethodSet
    from rsibr.methods.reconstruction import reconstruct as reconstruct
    from rsibr.methods.registry import method_names as method_names
    from rsibr.scene.config import load_config as load_config
    from rsibr.store.bake import open_bake as open_bake
    from rsibr.studies.runner import study as study
    from rsibr.validation.health.check import check as check
    from rsibr.validation.validation import validate as validate

__version__ = "0.2.0"

_HOME = {
    "MethodSet": "rsibr.methods.method_set",
    "bake": "rsibr.budget.bake",
    "check": "rsibr.validation.health.check",
    "method_names": "rsibr.methods.registry",
    "load_config": "rsibr.scene.config",
    "open_bake": "rsibr.store.bake",
    "plan": "rsibr.budget.bake",
    "reconstruct": "rsibr.methods.reconstruction",
    "study": "rsibr.studies.runner",
    "validate": "rsibr.validation.validation",
}

__all__ = [
    "MethodSet",
    "__version__",
    "bake",
    "check",
    "load_config",
    "method_names",
    "open_bake",
    "plan",
    "reconstruct",
    "study",
    "validate",
]


def __getattr__(name: str) -> Any:
    """Import public names at their first use, so that `import rsibr` loads neither Mitsuba nor matplotlib."""
    if name not in _HOME:
        raise AttributeError(f"module 'rsibr' has no attribute '{name}'")
    value = getattr(importlib.import_module(_HOME[name]), name)
    return globals().setdefault(name, value)


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return __all__
