"""rsibr: reflection-space image based rendering on Mitsuba 3, with its error known.

Bake a material under a distant environment into a few radiance sphere maps, reconstruct the map of any other view from
them, and compare it with path-traced truth:

>>> import rsibr
>>> bake = rsibr.bake("configs/demo.toml", out="out/paint.rsibr")           # doctest: +SKIP
>>> paint = rsibr.reconstruct(bake, view=(1, 2, 3), method="cabral1999")    # doctest: +SKIP
>>> report = rsibr.validate(bake, views=8, out="out/report")                # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rsibr.reconstruct.methods import METHODS as METHODS
    from rsibr.reconstruct.reconstruction import reconstruct as reconstruct
    from rsibr.scene.config import load_config as load_config
    from rsibr.store.bake import open_bake as open_bake
    from rsibr.study.budget import bake as bake
    from rsibr.study.budget import plan as plan
    from rsibr.study.runner import study as study
    from rsibr.validate.check import check as check
    from rsibr.validate.validation import validate as validate

__version__ = "0.1.0"

_HOME = {
    "METHODS": "rsibr.reconstruct.methods",
    "bake": "rsibr.study.budget",
    "check": "rsibr.validate.check",
    "load_config": "rsibr.scene.config",
    "open_bake": "rsibr.store.bake",
    "plan": "rsibr.study.budget",
    "reconstruct": "rsibr.reconstruct.reconstruction",
    "study": "rsibr.study.runner",
    "validate": "rsibr.validate.validation",
}

__all__ = [
    "METHODS",
    "__version__",
    "bake",
    "check",
    "load_config",
    "open_bake",
    "plan",
    "reconstruct",
    "study",
    "validate",
]


def __getattr__(name: str) -> Any:
    """Import what is asked for, when it is asked for: `import rsibr` loads neither Mitsuba nor matplotlib."""
    if name not in _HOME:
        raise AttributeError(f"module 'rsibr' has no attribute '{name}'")
    value = getattr(importlib.import_module(_HOME[name]), name)
    # A room of that name (`rsibr.bake`) is bound by its import, and can be called like its function: `callable_room`
    return globals().setdefault(name, value)


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return __all__
