"""Child process of `rsibr.scene.trial`: loads a user's plugin, which may crash it.

`python -m rsibr.scene.trial_child` reads one config section as JSON from stdin, loads it with the code that the caller
is about to use, and evaluates and samples it once; or several, under the key `several`, and says which survived.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi

from rsibr.errors import RsibrError
from rsibr.geometry.sphere_interaction import interaction
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.trial import BEGUN, SURVIVED

_DIRECTIONS = 64


def try_section(document: dict[str, Any]) -> None:
    """Load, evaluate and sample the section in `document`, or each of several; raises what the loader of one raises."""
    load_plugins(document.get("modules", ()))
    for section in document.get("several", ()):
        with suppress(RsibrError, RuntimeError):  # the parent process will raise it
            try_section(section)
        print(SURVIVED, flush=True)  # noqa: T201  # for the parent process
    if "several" in document:
        return
    context = {"base": Path.cwd()}
    if "environment" in document:
        load_environment(EnvironmentConfig.model_validate(document["environment"], context=context))
        return  # which has evaluated it
    material = load_material(MaterialConfig.model_validate(document["material"], context=context))
    _exercise(material.bsdf())


def main(attempt: Callable[[dict[str, Any]], None] = try_section) -> int:
    """Run one trial; any exit code means that the process did not crash.

    Parameters
    ----------
    attempt : callable
        Loads what the document from stdin holds, and raises what the loader raises.
    """
    document = json.load(sys.stdin)
    print(BEGUN, flush=True)  # noqa: T201  # for the parent process
    try:
        attempt(document)
    except (RsibrError, RuntimeError):  # the parent process will raise it too
        return 1
    return 0


def _exercise(bsdf: mi.BSDF) -> None:
    u = dr.linspace(mi.Float, 0.01, 0.99, _DIRECTIONS)
    si = interaction(mi.warp.square_to_cosine_hemisphere(mi.Point2f(u, dr.opaque(mi.Float, 0.5))))
    context = mi.BSDFContext()
    sample, weight = bsdf.sample(context, si, u, mi.Point2f(u, u))
    dr.eval(weight, bsdf.eval(context, si, sample.wo), bsdf.pdf(context, si, sample.wo))
    dr.sync_thread()


if __name__ == "__main__":
    sys.exit(main())
