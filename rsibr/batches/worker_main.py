"""Process of a worker: `python -m rsibr.batches.worker_main DESCRIPTOR`, started by `rsibr.batches.worker_process`.

It runs the tasks that come over the socket, one after another, and ends at once when its coordinator is gone.
"""

from __future__ import annotations

import faulthandler
import json
import os
import resource
import signal
import sys
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any

from rsibr.batches.tasks import Task

_PAUSE = 0.5
"""Time between two reports of progress [s]."""


def main() -> None:
    """Serve tasks until the coordinator closes the socket."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal: the coordinator hears it, and ends its workers
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    faulthandler.enable()
    connection, tasks = Connection(int(sys.argv[1])), SimpleQueue[dict[str, Any]]()
    sending = Lock()

    def send(message: dict[str, Any]) -> None:
        with sending:
            connection.send_bytes(json.dumps(message).encode())

    Thread(target=_listen, args=(connection, tasks.put), name="rsibr-coordinator", daemon=True).start()
    from rsibr.batches.worker import run_task, worker_name  # noqa: PLC0415  # loads Mitsuba: listen before that
    from rsibr.scene.trial import IN_TRIAL  # noqa: PLC0415

    os.environ[IN_TRIAL] = "1"  # plugins need no process in which they may crash: they have this one
    send({"ready": worker_name()})
    while True:
        asked = tasks.get()
        outcome = run_task(
            Task.from_record(asked["task"]), Path(asked["out"]), threads=asked["threads"], on_progress=sparse(send)
        )
        send({"outcome": outcome.to_record()})


def _listen(connection: Connection, take: Callable[[dict[str, Any]], None]) -> None:
    """Take tasks; end the process with its coordinator, also in the middle of a kernel."""
    while True:
        try:
            take(json.loads(connection.recv_bytes()))
        except (EOFError, OSError):
            os._exit(0)


def sparse(send: Callable[[dict[str, Any]], None]) -> Callable[[float], None]:
    """Report progress, not too often."""
    last = time.monotonic()

    def report(share: float) -> None:
        nonlocal last
        if time.monotonic() - last > _PAUSE:
            last = time.monotonic()
            send({"share": share})

    return report


if __name__ == "__main__":
    main()
