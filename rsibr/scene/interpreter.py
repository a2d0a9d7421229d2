"""Search for a Python interpreter to start child processes with.

`sys.executable` need not be one: if Python is embedded it may be the host program, empty, or a frozen application,
which would start itself again.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from multiprocessing.spawn import get_executable
from pathlib import Path

from rsibr.errors import InputError

OVERRIDE = "RSIBR_PYTHON"
"""Environment variable that names the interpreter."""

_NAME = re.compile(r"(python|pypy)[\d.]*[a-z]?(\.exe)?", re.IGNORECASE)


def interpreters() -> Iterator[str]:
    """Candidate paths of Python interpreters, most likely first; none of them has been run.

    `RSIBR_PYTHON` alone if it is set. Otherwise the executable of `multiprocessing` (see
    `multiprocessing.set_executable`), `sys.executable`, the interpreter from which a virtual environment was made, and
    those in Python's own folders. Programs with other names than Python's are excluded.

    Raises
    ------
    InputError
        If `RSIBR_PYTHON` does not name a file.
    """
    chosen = os.environ.get(OVERRIDE)
    if chosen:
        if not Path(chosen).is_file():
            raise InputError(f"there is no file {chosen}", where=OVERRIDE, fix="name a Python interpreter, or unset it")
        yield chosen
        return
    yield from dict.fromkeys(path for path in _places() if _NAME.fullmatch(Path(path).name) and Path(path).is_file())


def search_path() -> str:
    """`PYTHONPATH` with which a child can import everything that this process can, including rsibr."""
    entries = [*os.environ.get("PYTHONPATH", "").split(os.pathsep), *(entry for entry in sys.path if entry)]
    current = [str(Path.cwd())] if "" in sys.path else []
    root = str(Path(__file__).parents[2])
    return os.pathsep.join(dict.fromkeys([*filter(None, entries), *current, root]))


def _places() -> Iterator[str]:
    base = getattr(sys, "_base_executable", None)
    yield from (os.fsdecode(path) for path in (get_executable(), sys.executable, base) if path)
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    for prefix in (sys.exec_prefix, sys.base_exec_prefix):
        for name in (f"bin/python{version}", "bin/python3", "python.exe", "Scripts/python.exe"):
            yield str(Path(prefix, name))
