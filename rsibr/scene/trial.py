"""Trial of a user's plugin in a child process, so that a crash of Mitsuba becomes an error message.

Some plugins end the process on input that they do not expect. The other process is `rsibr.scene.trial_child`. Only a
crash or a hang is a finding: what Mitsuba refuses in an orderly way, the caller hears from Mitsuba itself.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import rsibr
from rsibr.errors import InputError
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.plugin import named_files

TIMEOUT = 60.0
"""Seconds after which a trial counts as hung; it normally takes one or two."""

IN_TRIAL = "RSIBR_IN_TRIAL"
"""Environment variable that is set in a trial, so that it starts no further one."""

_survived: set[str] = set()


def require_survival(config: EnvironmentConfig | MaterialConfig, where: str, timeout: float = TIMEOUT) -> None:
    """Load an environment or a material in a child process, unless the same content has survived that before.

    Parameters
    ----------
    config : EnvironmentConfig or MaterialConfig
        The section of the config.
    where : str
        File or config key that an error names.
    timeout : float
        Seconds after which the child counts as hung.

    Raises
    ------
    InputError
        If the child crashes, or does not end in time.
    """
    if os.environ.get(IN_TRIAL):
        return
    kind = "environment" if isinstance(config, EnvironmentConfig) else "material"
    document = json.dumps({kind: config.model_dump(mode="json", exclude_none=True)})
    content = hashlib.sha256(document.encode() + b"".join(map(_content, _files(config)))).hexdigest()
    if content in _survived:
        return
    code = _run_child(document, where, timeout)
    if code < 0:
        raise InputError(
            f"Mitsuba crashed ({_signal_name(-code)}) while loading it",
            where=where,
            fix="check its parameters and nested plugins against Mitsuba's plugin reference",
        )
    _survived.add(content)


def _run_child(document: str, where: str, timeout: float) -> int:
    search = os.pathsep.join([str(Path(rsibr.__file__).parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        return subprocess.run(
            [sys.executable, "-m", "rsibr.scene.trial_child"],
            input=document.encode(),
            env=os.environ | {IN_TRIAL: "1", "PYTHONPATH": search},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=timeout,
            check=False,
        ).returncode
    except subprocess.TimeoutExpired:
        raise InputError(f"Mitsuba did not load it within {timeout:.0f} s", where=where, fix="simplify it") from None


def _files(config: EnvironmentConfig | MaterialConfig) -> list[Path]:
    plugin = config.emitter if isinstance(config, EnvironmentConfig) else config.bsdf
    return [*filter(None, [config.file]), *named_files(plugin or {})]


def _content(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest() if file.is_file() else b""


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
