"""Executor "dask": workers of a Dask cluster, on this machine or on many. Dask schedules; this only feeds it.

Results and bakes are on the disk, which all machines share; small records come back. No more than some tasks a worker
are handed over at a time: a scheduler chokes on hundreds of thousands. A task whose workers died (Dask's
`KilledWorker`) runs once more as a child process of a worker, which survives it and tells the signal.
"""

from __future__ import annotations

import logging
import os
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from rsibr.batches.batch_lock import LOCK_NAME
from rsibr.batches.config import RunConfig
from rsibr.batches.executors.processes import worker_count
from rsibr.batches.executors.registry import register
from rsibr.batches.ledger import Death, Ledger
from rsibr.batches.result import JobResult
from rsibr.batches.tasks import Outcome, Task
from rsibr.batches.worker_process import run_alone
from rsibr.errors import InputError, MachineError
from rsibr.version import __version__

WINDOW = 4
"""Tasks a worker that the scheduler holds."""

CONNECT = 10.0
"""Time within which a scheduler has to answer [s]."""

LOCAL = "local"

_TICK = 1.0
_CLOSE = 2.0

_SETTINGS = {
    "distributed.scheduler.worker-saturation": 1.0,  # whatever waits on a worker that dies is suspected with it
    "distributed.scheduler.allowed-failures": 1,
    "distributed.scheduler.worker-ttl": None,  # a worker in a long kernel is not dead
    "distributed.comm.timeouts.connect": f"{CONNECT:.0f}s",
}


@register("dask")
class Dask:
    """Runs tasks on a Dask cluster."""

    crowded = False

    def workers(self, run: RunConfig) -> int:
        """Workers of a cluster of this machine; of another one they are not known yet."""
        return worker_count(run) if _is_local(run) else 1

    def run(self, ledger: Ledger, run: RunConfig) -> None:
        """Run the tasks of a ledger; see `Executor`."""
        distributed = _distributed()
        with _quiet(), _connected(distributed, run) as client:
            if (link := _dashboard(client)) is not None:
                ledger.note(f"Dask's dashboard: {link}")
            _Feed(distributed, client, ledger, run.threads).run()


def _is_local(run: RunConfig) -> bool:
    return run.scheduler in (None, LOCAL)


def _distributed() -> Any:
    try:
        import distributed  # noqa: PLC0415  # of the extra `batch`
    except ImportError:
        raise MachineError(
            "Dask is not installed", where="executor dask", fix='install it with `pip install "rsibr[batch]"`'
        ) from None
    return distributed


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence Dask's log, which tells each lost worker in pages; what matters of it is told in a line."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


@contextmanager
def _connected(distributed: Any, run: RunConfig) -> Iterator[Any]:
    """Connect to the scheduler, or start a cluster on this machine; it ends with the block."""
    import dask  # noqa: PLC0415

    with dask.config.set(_SETTINGS), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a port that another dashboard has
        if not _is_local(run):
            with _client(distributed, str(run.scheduler)) as client:
                yield client
            return
        cluster = distributed.LocalCluster(
            n_workers=worker_count(run),
            threads_per_worker=1,
            processes=True,
            memory_limit=0,  # Dask would end a worker that takes its share, and more than that may be free
            silence_logs=logging.CRITICAL + 1,
        )
        try:
            with _client(distributed, cluster) as client:
                yield client
        finally:
            _end(cluster)


@contextmanager
def _client(distributed: Any, address: Any) -> Iterator[Any]:
    try:
        client = distributed.Client(address, timeout=CONNECT, set_as_default=False)
    except OSError as error:  # TimeoutError among them
        raise MachineError(
            f"no Dask scheduler answers within {CONNECT:.0f} s ({type(error).__name__})",
            where=str(address),
            fix="start it with `dask scheduler`, and check address and firewall",
        ) from None
    except (ValueError, TypeError) as error:
        raise InputError(
            f"is no address of a scheduler: {error}", where=str(address), fix="give one as tcp://HOST:8786"
        ) from None
    try:
        yield client
    finally:
        with suppress(Exception):
            client.close(timeout=_CLOSE)


def _end(cluster: Any) -> None:
    """End the cluster's workers at once, in whatever kernel they are, and then the cluster."""
    for nanny in list(cluster.workers.values()):
        with suppress(Exception):
            os.kill(nanny.pid, 9)
    with suppress(Exception):
        cluster.close(timeout=_CLOSE)


def _dashboard(client: Any) -> str | None:
    has_one = "dashboard" in client.scheduler_info().get("services", {})
    return str(client.dashboard_link) if has_one else None


class _Feed:
    """Hands tasks of a ledger to a scheduler, and takes what comes back."""

    def __init__(self, distributed: Any, client: Any, ledger: Ledger, threads: int) -> None:
        self._killed: type[Exception] = distributed.KilledWorker
        self._client, self._ledger, self._threads = client, ledger, threads
        self._heard: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._topic = f"rsibr-{uuid4().hex}"
        self._futures: dict[int, tuple[Any, Task]] = {}
        self._count = 0
        self._workers: dict[str, int] = {}
        self._looked = -_TICK

    def run(self) -> None:
        """Feed the scheduler until the ledger is over."""
        self._client.subscribe_topic(self._topic, lambda event: self._heard.put(lambda: self._said(event[1])))
        try:
            while not self._ledger.is_over:
                self._look()
                self._fill()
                with suppress(Empty):
                    self._heard.get(timeout=_TICK)()
        finally:
            with suppress(Exception):
                self._client.cancel([future for future, _ in self._futures.values()], force=True)

    def _look(self) -> None:
        """See which workers there are."""
        if time.monotonic() - self._looked < _TICK:
            return
        try:
            if self._client.status not in ("running", "newly-created"):
                raise OSError
            found: dict[str, int] = self._client.sync(self._client.scheduler.ncores, workers=None)
        except Exception:
            raise self._lost_scheduler() from None
        self._looked = time.monotonic()
        for address in found.keys() - self._workers.keys():
            self._ledger.worker_up(_short(address))
            if found[address] > 1:
                self._ledger.note(
                    f"{_short(address)} has {found[address]} Dask threads, of which one at a time can work: start "
                    "workers with --nthreads 1"
                )
        for address in self._workers.keys() - found.keys():
            self._ledger.worker_gone(_short(address), "lost")
        if not found and not self._workers and self._count == 0:
            self._ledger.note("the scheduler has no workers yet")
        self._workers = found
        self._ledger.workers = max(1, len(found))

    def _lost_scheduler(self) -> MachineError:
        return MachineError(
            "the Dask scheduler was lost",
            where=str(self._client.scheduler.address) if self._client.scheduler else "",
            fix="start it again, then run the same command again: what is whole is kept",
        )

    def _fill(self) -> None:
        """Hand over tasks until there are enough."""
        while self._ledger.in_flight < WINDOW * self._ledger.workers:
            task = self._ledger.next()
            if task is None:
                return
            self._count += 1
            number = self._count
            future = self._client.submit(
                run_on_worker,
                task.to_record(),
                str(self._ledger.out.absolute()),
                self._threads,
                self._topic,
                number,
                __version__,
                key=(self._topic, number),  # one group: Dask then holds back what its workers do not need yet
                pure=False,
                **self._where(task),
            )
            self._futures[number] = future, task
            future.add_done_callback(lambda _, number=number: self._heard.put(lambda: self._ended(number)))

    def _where(self, task: Task) -> dict[str, Any]:
        """Keywords of `submit` for the workers that a task should run on; none where any will do."""
        kept = [one for one in self._workers if _short(one) != task.avoid and not self._ledger.rests(_short(one))]
        some = kept and len(kept) < len(self._workers)
        return {"workers": kept, "allow_other_workers": True} if some else {}

    def _said(self, message: dict[str, Any]) -> None:
        """Hear what a worker says about the task that it runs."""
        found = self._futures.get(message["task"])
        if found is None:
            return
        if "share" in message:
            self._ledger.progressed(found[1], message["share"])
        else:
            self._ledger.started(found[1], _short(message["worker"]))  # Dask puts the address there

    def _ended(self, number: int) -> None:
        future, task = self._futures.pop(number)
        if future.status in ("cancelled", "lost"):
            raise self._lost_scheduler()
        try:
            record = future.result(timeout=CONNECT)
        except self._killed:
            self._ledger.died(task, Death(lost=True))
            return
        except MachineError:
            raise
        except Exception as error:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            fix = f"install rsibr {__version__} on every node, with the same Python"
            raise MachineError(f"a worker cannot run rsibr ({what[:200]})", where="dask", fix=fix) from None
        finally:
            future.release()
        if "death" in record:
            self._ledger.died(task, Death(**record["death"]))
        else:
            self._ledger.ended(task, Outcome.from_record(record["outcome"]), record["worker"])


def _short(address: str) -> str:
    """Address of a worker without its protocol."""
    return address.rpartition("//")[2]


def run_on_worker(
    record: dict[str, Any], out: str, threads: int, topic: str, number: int, version: str
) -> dict[str, Any]:
    """Run a task in a worker of Dask.

    Parameters
    ----------
    record : dict
        The task.
    out : str
        Directory of the batch, which all machines share.
    threads : int
        Threads of Dr.Jit.
    topic, number : str, int
        Where it says that it has begun and how far it is, and what it calls itself there.
    version : str
        Version of rsibr that the coordinator has.

    Returns
    -------
    dict
        Record of the outcome and name of the worker; or how the child process ended, of a task that runs alone.

    Raises
    ------
    MachineError
        If this node has another version of rsibr.
    """
    from distributed import get_worker  # noqa: PLC0415

    worker = get_worker()
    name = _short(worker.address)
    if version != __version__:
        what = f"{name} has rsibr {__version__}, the coordinator {version}"
        raise MachineError(what, where="dask", fix="install the same version on every node")
    task, folder = Task.from_record(record), Path(out)
    worker.log_event(topic, {"task": number, "worker": worker.address})
    if not (folder / LOCK_NAME).exists():
        reason = f"{out}: {name} does not see the directory of the batch. Mount it there under the same path"
        result = JobResult.of(task.job, "failed", reason=reason, exit_code=MachineError.exit_code, worker=name)
        return {"outcome": Outcome(result).to_record(), "worker": name}
    if task.alone:
        found = run_alone(task, folder, threads)
        return {"death": asdict(found)} if isinstance(found, Death) else {"outcome": found, "worker": name}
    from rsibr.batches.worker import run_task  # noqa: PLC0415  # loads Mitsuba
    from rsibr.batches.worker_main import sparse  # noqa: PLC0415
    from rsibr.scene.trial import IN_TRIAL  # noqa: PLC0415

    os.environ[IN_TRIAL] = "1"  # plugins need no process in which they may crash: they have this one
    report = sparse(lambda message: worker.log_event(topic, {"task": number, **message}))
    outcome = run_task(task, folder, threads=threads, on_progress=report)
    return {"outcome": outcome.to_record(), "worker": name}
