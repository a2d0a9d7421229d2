"""Trial of a user's plugin in a child process, so that a crash of Mitsuba becomes an error message.

Some plugins abort the process on invalid input. `python -m rsibr.scene.trial` reads one config section as JSON from
stdin, loads it with the code that the caller is about to use, and evaluates and samples it once. Only a crash or a hang
is reported; errors that Mitsuba raises are left to the caller, who will get them as well.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi

import rsibr
from rsibr.errors import InputError, RsibrError
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.plugin import named_files

TIMEOUT = 60.0
"""Seconds after which a trial counts as hung; it normally takes one or two."""

IN_TRIAL = "RSIBR_IN_TRIAL"
"""Environment variable that is set in a trial, so that it starts no further one."""

_DIRECTIONS = 64

_survived: set[str] = set()


def require_survival(config: EnvironmentConfig | MaterialConfig, where: str) -> None:
    """Load an environment or a material in a child process, unless the same content passed before.

    Parameters
    ----------
    config : EnvironmentConfig or MaterialConfig
        The section of the config.
    where : str
        File or config key that an error names.

    Raises
    ------
    InputError
        If the child crashes, or does not end within `TIMEOUT`.
    """
    if os.environ.get(IN_TRIAL):
        return
    kind = "environment" if isinstance(config, EnvironmentConfig) else "material"
    document = json.dumps({kind: config.model_dump(mode="json", exclude_none=True)})
    content = hashlib.sha256(document.encode() + b"".join(map(_content, _files(config)))).hexdigest()
    if content in _survived:
        return
    code = _run_child(document, where)
    if code < 0:
        raise InputError(
            f"Mitsuba crashed ({_signal_name(-code)}) while loading it",
            where=where,
            fix="check its parameters and nested plugins against Mitsuba's plugin reference",
        )
    _survived.add(content)


def try_section(document: dict[str, dict[str, Any]]) -> None:
    """Load, evaluate and sample the section in `document`; raises what the loader raises."""
    # Imported here because the loaders import this module
    from rsibr.scene.environment import load_environment  # noqa: PLC0415
    from rsibr.scene.material import load_material  # noqa: PLC0415

    context = {"base": Path.cwd()}
    if "environment" in document:
        load_environment(EnvironmentConfig.model_validate(document["environment"], context=context))
        return  # which has evaluated it
    material = load_material(MaterialConfig.model_validate(document["material"], context=context))
    _exercise(material.bsdf())


def main() -> int:
    """Run one trial; any exit code means that the process did not crash."""
    document = json.load(sys.stdin)
    try:
        try_section(document)
    except (RsibrError, RuntimeError):  # the parent process will raise it too
        return 1
    return 0


def _exercise(bsdf: mi.BSDF) -> None:
    u = dr.linspace(mi.Float, 0.01, 0.99, _DIRECTIONS)
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.warp.square_to_cosine_hemisphere(mi.Point2f(u, dr.opaque(mi.Float, 0.5)))
    context = mi.BSDFContext()
    sample, weight = bsdf.sample(context, si, u, mi.Point2f(u, u))
    dr.eval(weight, bsdf.eval(context, si, sample.wo), bsdf.pdf(context, si, sample.wo))
    dr.sync_thread()


def _run_child(document: str, where: str) -> int:
    search = os.pathsep.join([str(Path(rsibr.__file__).parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        return subprocess.run(
            [sys.executable, "-m", "rsibr.scene.trial"],
            input=document.encode(),
            env=os.environ | {IN_TRIAL: "1", "PYTHONPATH": search},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=TIMEOUT,
            check=False,
        ).returncode
    except subprocess.TimeoutExpired:
        raise InputError(f"Mitsuba did not load it within {TIMEOUT:.0f} s", where=where, fix="simplify it") from None


def _files(config: EnvironmentConfig | MaterialConfig) -> list[Path]:
    plugin = config.emitter if isinstance(config, EnvironmentConfig) else config.bsdf
    return [*filter(None, [config.file]), *named_files(plugin or {})]


def _content(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest() if file.is_file() else b""


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"


if __name__ == "__main__":
    sys.exit(main())
