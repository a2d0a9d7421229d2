"""`rsibr doctor`: check whether this machine can run a bake, and say how to fix what is missing.

Mitsuba is imported inside the functions, because a broken installation of it is one of the findings.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from rsibr import machine
from rsibr.errors import MachineError, RsibrError
from rsibr.version import __version__

PACKAGES = ("mitsuba", "drjit", "numpy", "OpenEXR")
ROOMY_MEMORY = 2 * 1024**3
"""Upper bound on the memory of a bake of twelve maps of 256² [bytes]."""
ROOMY_DISK = 1024**3
"""Upper bound on the disk space of a bake of twelve maps of 1024² [bytes]."""

TRIAL = """
import json, time
import drjit as dr, mitsuba as mi, numpy as np
from rsibr import backend
print("kernel", flush=True)
backend.use()
start = time.perf_counter()
total = dr.sum(dr.maximum(dr.arange(mi.Float, 1024), 512))[0]
backend.synchronize()
assert total == 512 * 512 + sum(range(512, 1024)), total
seconds = time.perf_counter() - start
print("OpenEXR file", flush=True)
with backend.loading():
    stream = mi.MemoryStream()
    mi.Bitmap(np.ones((4, 8, 3), np.float32)).write(stream, mi.Bitmap.FileFormat.OpenEXR)
    stream.seek(0)
    assert np.array(mi.Bitmap(stream)).mean() == 1
print(json.dumps({"seconds": seconds, "threads": dr.thread_count()}))
"""
"""Kernel with the instruction that aborts an old LLVM, then a file that hangs where Dr.Jit's pool has one thread.

Runs in a child process, so that an abort or a hang becomes a finding. Each step prints its name first.
"""

TRIAL_SECONDS = 120.0
"""Time limit of the trial [s]."""


@dataclass(frozen=True)
class Lack:
    """Reason why rsibr cannot run here: cause, location, remedy, and exit code."""

    what: str
    where: str
    fix: str
    exit_code: int

    @classmethod
    def of(cls, error: RsibrError) -> Lack:
        """Make the finding of an error."""
        return cls(error.what, error.where, error.fix, error.exit_code)

    def __str__(self) -> str:
        """Return the finding in one line."""
        return str(RsibrError(self.what, where=self.where, fix=self.fix))


@dataclass(frozen=True)
class Diagnosis:
    """Result of `rsibr doctor`. Sizes in bytes, times in seconds, None for unknown values.

    Attributes
    ----------
    packages : dict
        Installed version of each package that determines results.
    backend : dict
        `variant` and `device` that a bake uses, whether `cuda` works, `llvm_version` and `llvm_path` as loaded.
    kernel : dict
        `seconds` of the trial kernel, including compilation, and `threads` of Dr.Jit; empty if the trial, which also
        reads a file, did not end well.
    cores : int
        Processor cores that this process may use.
    cache : dict
        Kernel cache of Dr.Jit on disk: `path` and `bytes`.
    memory, disk : dict
        `total` and `available`; the disk is that of the working directory.
    missing : tuple of Lack
        Reasons why rsibr cannot run here.
    advice : tuple of str
        Suggestions for a machine that can run it.
    """

    packages: dict[str, str | None]
    backend: dict[str, Any]
    kernel: dict[str, Any]
    cores: int
    cache: dict[str, Any]
    memory: dict[str, int | None]
    disk: dict[str, int]
    missing: tuple[Lack, ...]
    advice: tuple[str, ...]

    @property
    def exit_code(self) -> int:
        """0 if a bake can run, 3 if the machine lacks something, 2 if a setting of the user is invalid."""
        return self.missing[0].exit_code if self.missing else 0


def diagnose() -> Diagnosis:
    """Examine the installation and the machine, and run one small kernel if a backend is usable.

    Returns
    -------
    Diagnosis
        Missing resources are part of the result, not exceptions, even a libLLVM that aborts its process.
    """
    missing: list[Lack] = []
    backend: dict[str, Any] = {}
    kernel: dict[str, Any] = {}
    try:
        _look_at_backend(backend)
        kernel = _run_trial()
    except RsibrError as error:
        missing.append(Lack.of(error))
    cache, memory, usage = _kernel_cache(), asdict(machine.memory()), shutil.disk_usage(Path.cwd())
    disk = {"total": usage.total, "available": usage.free}
    packages = {"rsibr": __version__} | {name: _installed(name) for name in PACKAGES}
    advice = tuple(_advice(cache, memory, disk, kernel.get("threads")))
    cores = machine.usable_cores()
    return Diagnosis(packages, backend, kernel, cores, cache, memory, disk, tuple(missing), advice)


def doctor(
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Report what this machine has and what is missing: backend, LLVM, device, cache, threads, memory."""
    diagnosis = diagnose()
    if json_output:
        typer.echo(json.dumps({"usable": not diagnosis.missing, **asdict(diagnosis)}))
    else:
        _print(diagnosis)
    raise typer.Exit(diagnosis.exit_code)


def _look_at_backend(found: dict[str, Any]) -> None:
    """Fill `found` with the properties of the backend; raise an RsibrError if it is unusable."""
    try:
        from rsibr import backend
    except ImportError as error:
        wanted = " ".join(
            f"'{line}'" for line in metadata.requires("rsibr") or () if line.startswith(("mitsuba", "drjit"))
        )
        raise MachineError(f"Mitsuba cannot be imported: {error}", fix=f"run `pip install {wanted}`") from error
    report = backend.inspect()
    version = ".".join(map(str, report.llvm_version)) if report.llvm_version else None
    found |= {"variant": None, "device": None, "cuda": bool(report.cuda)}
    found |= {"llvm_version": version, "llvm_path": _loaded_llvm() or report.llvm_path}
    found["variant"] = backend.use()
    found["device"] = next(device for device, variant in backend.VARIANT_OF.items() if variant == found["variant"])


def _loaded_llvm() -> str | None:
    """Return the path of the libLLVM loaded in this process (Linux only)."""
    maps = Path("/proc/self/maps")
    if not maps.is_file():
        return None
    paths = (line.split(maxsplit=5)[-1] for line in maps.read_text().splitlines())
    return next((path for path in paths if Path(path).name.startswith("libLLVM")), None)


def _run_trial() -> dict[str, Any]:
    command = [sys.executable, "-c", TRIAL]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TRIAL_SECONDS, check=False)
    except subprocess.TimeoutExpired as error:
        step = _step(error.stdout)
        fix = "check the load of the machine, and whether it lets this process have more than one thread"
        raise MachineError(f"a trial {step} did not end within {TRIAL_SECONDS:.0f} s", fix=fix) from error
    if done.returncode != 0:
        last = next(reversed(done.stderr.strip().splitlines()), f"exit code {done.returncode}")
        fix = "try another libLLVM through DRJIT_LIBLLVM_PATH"
        raise MachineError(f"a trial {_step(done.stdout)} failed: {last}", fix=fix)
    kernel: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return kernel


def _step(printed: str | bytes | None) -> str:
    """Name of the step of the trial that had begun."""
    text = printed.decode() if isinstance(printed, bytes) else printed or ""
    return next(reversed(text.split("\n")[:-1]), "kernel")


def _installed(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _kernel_cache() -> dict[str, Any]:
    """Find the folder as Dr.Jit does: DRJIT_CACHE_DIR, else ~/.drjit, else no cache."""
    home = os.environ.get("HOME")
    path = os.environ.get("DRJIT_CACHE_DIR") or (f"{home}/.drjit" if home else None)
    size = 0
    for file in Path(path).glob("*") if path else ():
        with suppress(FileNotFoundError):  # another process may delete it meanwhile
            size += file.stat().st_size
    return {"path": path, "bytes": size}


def _advice(
    cache: dict[str, Any], memory: dict[str, int | None], disk: dict[str, int], threads: int | None
) -> Iterator[str]:
    if threads == 1:
        yield (
            "Dr.Jit has one thread, with which `mi.Bitmap` of an OpenEXR file hangs: the commands of rsibr are safe, "
            "in your own Mitsuba code call `dr.set_thread_count(2)` first"
        )
    if cache["path"] is None:
        yield "HOME is unset, so Dr.Jit keeps no compiled kernels: set DRJIT_CACHE_DIR"
    elif Path(cache["path"]).exists() and not os.access(cache["path"], os.W_OK):
        yield f"{cache['path']} is not writable, so Dr.Jit keeps no compiled kernels: set DRJIT_CACHE_DIR"
    if memory["available"] is not None and memory["available"] < ROOMY_MEMORY:
        yield f"only {_gib(memory['available'])} of memory are free: large maps may not fit"
    if disk["available"] < ROOMY_DISK:
        yield f"only {_gib(disk['available'])} of disk are free here: give `--out` a folder with more"


def _gib(size: int | None) -> str:
    return "unknown" if size is None else f"{size / 1024**3:.1f} GiB"


def _print(diagnosis: Diagnosis) -> None:
    from rich.console import Console
    from rich.table import Table

    from rsibr.cli.table import print_table

    table = Table.grid(padding=(0, 2))
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for label, value in _rows(diagnosis):
        table.add_row(label, value)
    print_table(table)
    console = Console(highlight=False, markup=False)
    for lack in diagnosis.missing:
        console.print(f"missing: {lack}", style="red", markup=False, soft_wrap=True)
    for line in diagnosis.advice:
        console.print(f"advice: {line}", style="yellow", markup=False, soft_wrap=True)
    if not diagnosis.missing:
        console.print("ready: nothing is missing", style="green")


def _rows(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    backend, kernel = diagnosis.backend, diagnosis.kernel
    yield "python", f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    yield "packages", ", ".join(f"{name} {version or 'not installed'}" for name, version in diagnosis.packages.items())
    yield "variant", f"{backend.get('variant') or 'none'}"
    yield "CUDA", "works" if backend.get("cuda") else "no device"
    yield "libLLVM", f"{backend.get('llvm_version') or 'not found'}  {backend.get('llvm_path') or ''}".strip()
    trial = f"ran in {1e3 * kernel['seconds']:.1f} ms on {kernel['threads']} threads" if kernel else "not run"
    yield "trial kernel", f"{trial} ({diagnosis.cores} of {os.cpu_count()} cores usable)"
    yield "kernel cache", f"{diagnosis.cache['path'] or 'none'}  {diagnosis.cache['bytes'] / 1024**2:.0f} MiB"
    for label, sizes in (("memory", diagnosis.memory), ("disk", diagnosis.disk)):
        yield label, f"{_gib(sizes['available'])} free of {_gib(sizes['total'])}"
