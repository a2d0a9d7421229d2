"""Lock of the directory of a batch: one coordinator at a time, or one of each shard.

The system's lock is released when its holder ends, also by `kill -9`. It may hold on one machine only, as on a
network's file system that is mounted without locks. So the holder also writes who it is, and a count that it raises;
whoever finds the note of another machine watches the count for some time. No clocks of two machines are compared.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsibr.errors import BakeError, RsibrError
from rsibr.store.atomic import read_bytes, unwritable, write_atomic

LOCK_NAME = ".batch-lock"

BEAT = 5.0
"""Time between two beats of a holder [s]."""

WATCH = 16.0
"""Time for which a note of another machine is watched [s]: three beats."""

Shard = tuple[int, int]
"""Index from 1, and number of shards."""

_UNSUPPORTED = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


@contextmanager
def batch_lock(
    out: Path, shard: Shard | None = None, on_wait: Callable[[str], None] = lambda _: None
) -> Iterator[None]:
    """Hold the directory of a batch inside the block.

    Parameters
    ----------
    out : Path
        Directory of the batch; it exists.
    shard : pair of int, optional
        Shard that is run. Other shards of the same number may run at once.
    on_wait : callable
        Called with a line if the note of another machine has to be watched.

    Raises
    ------
    BakeError
        If another process runs this batch, or this shard of it.
    MachineError
        If the disk is full or fails.
    """
    own = out / _name(shard)
    with (
        _held(out / LOCK_NAME, out, shared=shard is not None),
        _held(own.with_suffix(".lock"), out, shared=False),
    ):
        rivals = [note for note in _notes(out) if note.path == own or not _at_once(shard, note.shard)]
        _refuse_living(out, own, rivals, on_wait)
        with _beating(own):
            yield


def _at_once(one: Shard | None, other: Shard | None) -> bool:
    """Whether two shards, or the whole batch, may run at once."""
    return one is not None and other is not None and one != other and one[1] == other[1]


@dataclass(frozen=True)
class _Note:
    """Note of a holder."""

    path: Path
    shard: Shard | None
    data: dict[str, Any]

    @property
    def is_of_this_system(self) -> bool:
        """Whether its holder would hold the system's lock, if it lived."""
        return bool(self.data.get("system") == _system())


def _name(shard: Shard | None) -> str:
    return ".batch-owner.json" if shard is None else f".batch-owner-{shard[0]}-{shard[1]}.json"


def _notes(out: Path) -> list[_Note]:
    found = []
    for path in out.glob(".batch-owner*.json"):
        numbers = re.fullmatch(r"\.batch-owner(?:-(\d+)-(\d+))?\.json", path.name)
        data = _read(path)
        if numbers and data is not None:
            shard = (int(numbers[1]), int(numbers[2])) if numbers[1] else None
            found.append(_Note(path, shard, data))
    return found


def _read(path: Path) -> dict[str, Any] | None:
    with suppress(RsibrError, ValueError):
        data = json.loads(read_bytes(path, most=2**12))
        return data if isinstance(data, dict) else None
    return None


def _refuse_living(out: Path, own: Path, notes: list[_Note], on_wait: Callable[[str], None]) -> None:
    """Raise if the holder of a note lives: here it has a lock, and on another machine its note goes on changing."""
    for one in notes:
        if one.is_of_this_system and one.path != own and _is_held(one.path.with_suffix(".lock")):
            raise _refusal(out, one.data)
    foreign = [one for one in notes if not one.is_of_this_system]
    if not foreign:
        return
    hosts = ", ".join(sorted({str(one.data.get("host")) for one in foreign}))
    on_wait(f"{hosts} ran this batch last: watching for {WATCH:.0f} s whether it still does")
    end = time.monotonic() + WATCH
    while time.monotonic() < end:
        time.sleep(min(1.0, WATCH / 4))
        for one in foreign:
            now = _read(one.path)
            if now is not None and now != one.data:
                raise _refusal(out, now)


def _refusal(out: Path, data: dict[str, Any]) -> BakeError:
    who = f" ({data.get('host')}, process {data.get('pid')})" if data else ""
    fix = "wait until it ends, or choose another --out; parts of one batch run at once with --shard"
    return BakeError(f"another process runs this batch{who}", where=str(out), fix=fix)


@contextmanager
def _held(path: Path, out: Path, *, shared: bool) -> Iterator[None]:
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise unwritable(path, error) from error
    try:
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            holders = [one.data for one in _notes(out)]
            raise _refusal(out, holders[0] if holders else {}) from None
        except OSError as error:
            if error.errno not in _UNSUPPORTED:  # without locks there are the notes
                raise unwritable(path, error) from error
        yield
    finally:
        os.close(descriptor)


def _is_held(path: Path) -> bool:
    with suppress(OSError):
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(descriptor)
    return False


@contextmanager
def _beating(path: Path) -> Iterator[None]:
    """Keep a note that changes while this process lives."""
    note = {"host": socket.gethostname(), "pid": os.getpid(), "system": _system(), "beat": 0}

    def write() -> None:
        write_atomic(path, json.dumps(note).encode())

    def beat() -> None:
        while not ended.wait(BEAT):
            note["beat"] += 1  # type: ignore[operator]
            with suppress(RsibrError):  # a disk that is full for a moment
                write()

    write()
    ended = threading.Event()
    thread = threading.Thread(target=beat, name="rsibr-batch-lock", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        path.unlink(missing_ok=True)


def _system() -> str:
    """Name of this running system: processes of one see each other's locks, whatever container they are in."""
    with suppress(OSError):
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    return socket.gethostname()
