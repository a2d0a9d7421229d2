"""Trial of a user's plugin in a child process, so that a crash of Mitsuba becomes an error message.

Some plugins end the process on input that they do not expect. The other process is `rsibr.scene.trial_child`. Only a
crash or a hang is a finding: what Mitsuba refuses in an orderly way, the caller hears from Mitsuba itself.

The child imports the plugin modules that its parent has loaded (`rsibr.scene.python_plugins`). A plugin registered
directly in the parent, with `mi.register_bsdf`, does not exist in the child: such a section is loaded without a trial,
with a warning. The same applies if no Python interpreter is found for the child.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from rsibr.errors import InputError
from rsibr.regular_file import is_file
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.interpreter import OVERRIDE, interpreters, search_path
from rsibr.scene.plugin import named_files, named_types
from rsibr.scene.python_plugins import plugin_modules, registered_by_hand, sources_of
from rsibr.scene.xml_files import XmlFiles

TIMEOUT = 60.0
"""Seconds after which a trial counts as hung; it normally takes one or two."""

IN_TRIAL = "RSIBR_IN_TRIAL"
"""Environment variable that is set in a trial, so that it starts no further one."""

BEGUN = "rsibr trial begun"
"""Printed by the child once its imports succeeded; without it the interpreter could not run the trial."""

_NAME_THE_MODULE = 'Name its module in the config, as in plugins = {modules = ["my_plugins"]}, or with --import'

SURVIVED = "rsibr trial survived"
"""Printed by the child after each of several sections."""

MOST_TOGETHER = 200
"""Sections of one child."""

CHILD = "rsibr.scene.trial_child"
"""Module that loads an environment or a material."""

_survived: set[str] = set()


def require_survival(config: EnvironmentConfig | MaterialConfig, where: str, timeout: float = TIMEOUT) -> str:
    """Load an environment or a material in a child process, unless the same content has survived that before.

    Parameters
    ----------
    config : EnvironmentConfig or MaterialConfig
        The section of the config.
    where : str
        File or config key that an error names.
    timeout : float
        Seconds after which the child counts as hung.

    Returns
    -------
    str
        Reason why it was not tried, for `warn_untried` after loading; empty if it was.

    Raises
    ------
    InputError
        If the child crashes, or does not end in time.
    """
    if os.environ.get(IN_TRIAL):
        return ""
    return require_survival_of(CHILD, _section(config), _types(config), _files(config), where, timeout)


def try_together(
    configs: Sequence[EnvironmentConfig | MaterialConfig], on_tried: Callable[[int], None] = lambda _: None
) -> None:
    """Load environments and materials one after the other in as few child processes as there are crashes, and one.

    What survives is not tried again by `require_survival`; what crashes or hangs is, which then says so. A child takes
    a second or two to start, and a thousand materials are a matter of seconds after that.

    Parameters
    ----------
    configs : sequence of EnvironmentConfig or MaterialConfig
        Sections of configs.
    on_tried : callable
        Called with the number of sections that are tried, after each child.

    Raises
    ------
    InputError
        If a file that a section names is gone.
    """
    wanted = [one for one in configs if not registered_by_hand(_types(one))]
    contents = [_content_of(_section(one), _types(one), _files(one)) for one in wanted]
    rest = [number for number, content in enumerate(contents) if content not in _survived]
    while rest and not os.environ.get(IN_TRIAL):
        several, rest = rest[:MOST_TOGETHER], rest[MOST_TOGETHER:]
        document = {"several": [_section(wanted[number]) for number in several], "modules": list(plugin_modules())}
        tried = _survivors(json.dumps(document), TIMEOUT + len(several))
        if tried is None:
            return
        _survived.update(contents[number] for number in several[:tried])
        rest = several[tried + 1 :] + rest  # without the one that ended the child
        on_tried(len(wanted) - len(rest))


def _survivors(document: str, timeout: float) -> int | None:
    """How many sections a child has loaded until it ended; None if no interpreter could run one."""
    for interpreter in interpreters():
        try:
            said: bytes = _run(interpreter, document, timeout, CHILD).stdout
        except subprocess.TimeoutExpired as error:
            said = error.stdout or b""
        except OSError:
            continue
        if BEGUN.encode() in said:
            return said.count(SURVIVED.encode())
    return None


def _section(config: EnvironmentConfig | MaterialConfig) -> dict[str, Any]:
    kind = "environment" if isinstance(config, EnvironmentConfig) else "material"
    return {kind: config.model_dump(mode="json", exclude_none=True)}


def _content_of(section: dict[str, Any], types: Iterable[str], files: Iterable[Path]) -> str:
    """Digest of a section with the content of its files and of the plugins' source."""
    contents = b"".join(map(_content, [*files, *sources_of(types)]))
    return hashlib.sha256(json.dumps(section).encode() + contents).hexdigest()


def require_survival_of(
    child: str,
    section: dict[str, Any],
    types: Iterable[str],
    files: Iterable[Path],
    where: str,
    timeout: float = TIMEOUT,
) -> str:
    """Have a child process load plain data, unless the same content has survived that before.

    Parameters
    ----------
    child : str
        Module to run. It reads the section from stdin, as JSON with the plugin modules to load under `modules`, and
        prints `BEGUN` before it loads it.
    section : dict
        What to load.
    types : iterable of str
        Types of all plugins in it.
    files : iterable of Path
        Files that it names.
    where, timeout
        See `require_survival`, also for what is returned and raised.
    """
    if os.environ.get(IN_TRIAL):
        return ""
    by_hand = registered_by_hand(types)
    if by_hand:
        names = ", ".join(f"'{name}'" for name in by_hand)
        return f"{names}: registered in this process only, where no other process finds it. {_NAME_THE_MODULE}"
    document = json.dumps(section | {"modules": list(plugin_modules())})
    content = _content_of(section, types, files)
    if content in _survived:
        return ""
    code = _run_child(document, where, timeout, child)
    if code is None:
        return f"no Python interpreter was found to try {where} in. Name one in {OVERRIDE}"
    if code < 0:
        raise InputError(
            f"Mitsuba crashed ({_signal_name(-code)}) while loading it",
            where=where,
            fix="check its parameters and nested plugins against Mitsuba's plugin reference",
        )
    _survived.add(content)
    return ""


def warn_untried(reason: str) -> None:
    """Warn that a plugin was loaded without a trial, unless `reason`, from `require_survival`, is empty."""
    if reason:
        warnings.warn(f"loaded without a trial, so that a crash would have ended this process: {reason}", stacklevel=3)


def _run_child(document: str, where: str, timeout: float = TIMEOUT, child: str = CHILD) -> int | None:
    """Exit code of a trial, negative if a signal ended it; None if no interpreter could run one."""
    for interpreter in interpreters():
        code, begun = _attempt(interpreter, document, where, timeout, child)
        if begun:
            return code
    if os.environ.get(OVERRIDE):
        raise InputError(
            f"{os.environ[OVERRIDE]} cannot run rsibr", where=OVERRIDE, fix="name a Python that has it, or unset it"
        )
    return None


def _attempt(interpreter: str, document: str, where: str, timeout: float, child: str) -> tuple[int, bool]:
    """Exit code of one interpreter, and whether the trial began in it."""
    try:
        done = _run(interpreter, document, timeout, child)
    except subprocess.TimeoutExpired:
        raise InputError(f"Mitsuba did not load it within {timeout:.0f} s", where=where, fix="simplify it") from None
    except OSError:  # not executable, or not a program
        return 0, False
    return done.returncode, BEGUN.encode() in done.stdout


def _run(interpreter: str, document: str, timeout: float, child: str) -> subprocess.CompletedProcess[bytes]:
    """Run a trial to its end."""
    return subprocess.run(
        [interpreter, "-P", "-m", child],
        input=document.encode(),
        env=os.environ | {IN_TRIAL: "1", "PYTHONPATH": search_path()},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        timeout=timeout,
        check=False,
    )


def _types(config: EnvironmentConfig | MaterialConfig) -> set[str]:
    plugin = config.emitter if isinstance(config, EnvironmentConfig) else config.bsdf
    if plugin is not None:
        return named_types(plugin)
    return _xml(config).types if _is_xml(config) else set()


def _files(config: EnvironmentConfig | MaterialConfig) -> list[Path]:
    plugin = config.emitter if isinstance(config, EnvironmentConfig) else config.bsdf
    if _is_xml(config):
        xml = _xml(config)
        return [*(file for file, _ in xml.documents), *xml.spectra, *xml.data]
    return [*filter(None, [config.file]), *named_files(plugin or {})]


def _is_xml(config: EnvironmentConfig | MaterialConfig) -> bool:
    return isinstance(config, MaterialConfig) and config.file is not None


def _xml(config: EnvironmentConfig | MaterialConfig) -> XmlFiles:
    return XmlFiles.of(Path(config.file or ""), str(config.file))


def _content(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest() if is_file(file) else b""


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
