"""Process of a worker as its coordinator sees it: started, given one task after another, ended, replaced.

The process is `python -m rsibr.batches.worker_main`, a fresh interpreter: nothing of this process is inherited, and a
script that starts a batch needs no guard against being imported again. Both talk JSON over a socket of their own.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
from contextlib import suppress
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

from rsibr.batches.ledger import Death
from rsibr.batches.tasks import Task
from rsibr.errors import MachineError
from rsibr.scene.interpreter import interpreters, search_path

_TAIL = 2**16
_END = 5.0


class WorkerProcess:
    """Process that runs tasks.

    Attributes
    ----------
    connection : Connection
        Readable whenever `receive` would not wait.
    is_fresh : bool
        Whether it was given no task yet.
    """

    def __init__(self) -> None:
        interpreter = next(iter(interpreters()), None)
        if interpreter is None:
            raise MachineError("no Python interpreter was found to start workers with", fix="name one in RSIBR_PYTHON")
        self.connection, theirs = Pipe()
        self.is_fresh = True
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  # lives as long as the process
        with theirs:
            self._process = subprocess.Popen(
                [interpreter, "-P", "-m", "rsibr.batches.worker_main", str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=self._log,
                env=_environment(),
            )

    def give(self, task: Task, out: Path, threads: int) -> None:
        """Give it a task; it begins once it is done with its start."""
        self.is_fresh = False
        message = {"task": task.to_record(), "out": str(out.absolute()), "threads": threads}
        with suppress(OSError):  # it has ended, which `receive` tells
            self.connection.send_bytes(json.dumps(message).encode())

    def receive(self) -> dict[str, Any] | None:
        """Next message, waiting for it: `{"ready": …}`, `{"share": …}` or `{"outcome": …}`; None at its end."""
        try:
            message: dict[str, Any] = json.loads(self.connection.recv_bytes())
        except (EOFError, OSError):
            return None
        return message

    def death(self) -> Death:
        """How it ended; waits for that."""
        code = self._process.wait()
        return Death(_signal_name(-code), None, self._said()) if code < 0 else Death(None, code, self._said())

    def end(self) -> None:
        """End it at once, whatever it does: bakes are as whole as after any kill."""
        self.connection.close()
        self._process.kill()
        self._process.wait(_END)
        self._log.close()

    def last_line(self) -> str:
        """Last line that it wrote."""
        return (self._lines() or [""])[-1]

    def _lines(self) -> list[str]:
        end = self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, end - _TAIL))
        lines = [line.strip() for line in self._log.read().decode(errors="replace").splitlines()]
        return [line for line in lines if line]

    def _said(self) -> str:
        """Cause of death, and the line of Python at which it happened, if it wrote them (see `faulthandler`)."""
        lines = self._lines()
        said = [line for line in lines if line.startswith(("LLVM ERROR", "terminate called"))]
        threads = [number for number, line in enumerate(lines) if line.startswith("Current thread")]
        frames = [line for line in lines[threads[-1] :] if line.startswith("File ")] if threads else []
        own = [line for line in frames if "/lib/python" not in line]
        return ", ".join([*said[-1:], *(own or frames)[:1]])


def _environment() -> dict[str, str]:
    """Environment of a worker: the number of its threads is that of Dr.Jit alone."""
    return {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"} | os.environ | {"PYTHONPATH": search_path()}


def _signal_name(number: int) -> str:
    return signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"


def run_alone(task: Task, out: Path, threads: int) -> dict[str, Any] | Death:
    """Run one task in a fresh process, and return the record of its outcome, or how the process ended."""
    process = WorkerProcess()
    try:
        process.give(task, out, threads)
        while (message := process.receive()) is not None:
            if "outcome" in message:
                record: dict[str, Any] = message["outcome"]
                return record
        return process.death()
    finally:
        process.end()
