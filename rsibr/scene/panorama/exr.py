"""Reading of OpenEXR files in another process, so that no file can end or hang this one."""

from __future__ import annotations

import atexit
import json
import os
import select
import signal
import subprocess
import tempfile
import threading
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.interpreter import OVERRIDE, interpreters, search_path
from rsibr.scene.panorama.exr_server import BEGUN, decode
from rsibr.scene.panorama.picture import Picture

PATIENCE = 60.0
"""Seconds after which a small file counts as hung; it normally takes milliseconds."""

SPEED = 2e6
"""Bytes a second of a file, at the least, by which more patience is had with a large one."""


class _Server:
    """Process that decodes; started at the first file, used for the following ones, and again after a crash."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, request: dict[str, Any], patience: float) -> tuple[dict[str, Any], NDArray[np.float32]] | None:
        """Decode a file; None if no interpreter could be started."""
        with self._lock:
            for _ in range(2):  # a process that has waited for long enough may end while it is asked
                if not self._running() and not self._start():
                    return None
                answer = self._exchange(request, patience)
                if answer is not None:
                    return answer
            raise InputError("the process that reads OpenEXR ended at once, twice", fix=f"try another {OVERRIDE}")

    def close(self) -> None:
        """End the process, if there is one."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in filter(None, (process.stdin, process.stdout)):
            pipe.close()  # not buffered: there is nothing to flush

    def forget(self) -> None:
        """Leave the process to the parent from which this one was forked, with a lock that no thread holds."""
        self._lock, self._process = threading.Lock(), None

    def _running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def _start(self) -> bool:
        self.close()
        environment = os.environ | {"PYTHONPATH": search_path(), "OPENBLAS_NUM_THREADS": "1"}
        for interpreter in interpreters():
            try:
                process = subprocess.Popen(
                    [interpreter, "-P", "-m", "rsibr.scene.panorama.exr_server"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    bufsize=0,
                    env=environment,
                    start_new_session=True,  # an interrupt from the terminal is for the command alone
                )
            except OSError:  # not executable, or not a program
                continue
            self._process = process
            if self._line(time.monotonic() + PATIENCE) == BEGUN.encode():
                return True
            self.close()
        if os.environ.get(OVERRIDE):
            raise InputError(
                f"{os.environ[OVERRIDE]} cannot run rsibr", where=OVERRIDE, fix="name a Python that has it, or unset it"
            )
        return False

    def _exchange(self, request: dict[str, Any], patience: float) -> tuple[dict[str, Any], NDArray[np.float32]] | None:
        """Answer of the process; None if it had ended by itself."""
        assert self._process is not None
        assert self._process.stdin is not None
        deadline = time.monotonic() + patience
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            line = self._line(deadline)
            told = json.loads(line) if line else {}
            image = np.empty(told.get("shape", 0), np.float32)
            if "error" in told:
                return told, image
            if told and self._fill(image.data.cast("B") if image.size else memoryview(b""), deadline):
                return told, image
        except BrokenPipeError:
            pass
        except TimeoutError:
            self.close()
            raise InputError(f"was not read within {patience:.0f} s", fix="save it again as OpenEXR") from None
        except BaseException:  # an interrupt: what it still says answers no later request
            self.close()
            raise
        code = self._process.wait()
        self.close()
        if code == 0:
            return None
        ended = _signal_name(-code) if code < 0 else f"exit code {code}"
        raise InputError(f"is damaged: OpenEXR crashed ({ended}) while reading it", fix="save it again as OpenEXR")

    def _line(self, deadline: float) -> bytes:
        """Next line without its end; empty if the process has ended."""
        line = bytearray()
        while not line.endswith(b"\n"):
            byte = self._read(1, deadline)
            if not byte:
                return b""
            line += byte
        return bytes(line[:-1])

    def _fill(self, target: memoryview, deadline: float) -> bool:
        done = 0
        while done < len(target):
            chunk = self._read(min(len(target) - done, 1 << 20), deadline)
            if not chunk:
                return False
            target[done : done + len(chunk)] = chunk
            done += len(chunk)
        return True

    def _read(self, size: int, deadline: float) -> bytes:
        assert self._process is not None
        assert self._process.stdout is not None
        descriptor = self._process.stdout.fileno()
        if not select.select([descriptor], [], [], max(0.0, deadline - time.monotonic()))[0]:
            raise TimeoutError
        return os.read(descriptor, size)


_server = _Server()
atexit.register(_server.close)
os.register_at_fork(after_in_child=_server.forget)


def read_exr(path: Path, layer: str | None, most_texels: int) -> Picture:
    """Read the environment in an OpenEXR file.

    Parameters
    ----------
    path : Path
        The file: scan lines or tiles, half or float, any compression.
    layer : str, optional
        Layer, part or view, where there are several; see `rsibr.scene.panorama.exr_channels.choose`.
    most_texels : int
        Texels at most.

    Returns
    -------
    Picture

    Raises
    ------
    InputError
        If the file is truncated, damaged or no picture, or its header states what cannot be obeyed.

    Warns
    -----
    UserWarning
        If no Python interpreter is found to start a process with: the file is then read in this one.
    """
    where = str(path)
    # The child may have started in another working folder
    request = {"path": str(path.absolute()), "layer": layer, "most_texels": most_texels}
    try:
        where.encode()
        found = _server.ask(request, PATIENCE + path.stat().st_size / SPEED) or _here(request)
    except UnicodeEncodeError:
        raise InputError("its name is not UTF-8, which OpenEXR needs", where=repr(where), fix="rename it") from None
    except InputError as error:
        raise InputError(error.what, where=error.where or where, fix=error.fix) from None
    told, image = found
    if "error" in told:
        what, fix = told["error"]
        raise InputError(what, where=where, fix=fix)
    colour = np.repeat(image, 3, axis=-1) if image.shape[-1] == 1 else image
    chromaticities, neutral = told["chromaticities"], told["neutral"]
    return Picture(
        image=colour,
        xyz=told["xyz"],
        chromaticities=None if chromaticities is None else tuple(chromaticities),
        neutral=None if neutral is None else tuple(neutral),
        layout=told["layout"],
        notes=tuple(told["notes"]),
    )


def _here(request: dict[str, Any]) -> tuple[dict[str, Any], NDArray[np.float32]]:
    """Decode in this process."""
    warnings.warn(
        f"{request['path']} is read in this process, which a damaged file may end: no Python interpreter was found to "
        f"read it in. Name one in {OVERRIDE}",
        stacklevel=4,
    )
    with tempfile.TemporaryFile() as log:
        return decode(request["path"], request["layer"], request["most_texels"], log)


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
