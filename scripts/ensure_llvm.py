"""See to a libLLVM that Dr.Jit can use, and write the shell lines that let it be found.

Run by the Makefile with the virtual environment's Python: `ensure_llvm.py ENV_FILE`. On a machine where Dr.Jit finds a
usable libLLVM (or a CUDA device) by itself it only says so. Otherwise it looks where Dr.Jit does not, then asks apt,
dnf, brew and conda in turn, and ends with one line and exit code 3 where none of them can help.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from rsibr.backend import INSTALL_LLVM, MINIMUM_LLVM
from rsibr.errors import MachineError

TESTED_LLVM = 19
"""The version that the tests run with; of those on offer the nearest to it is installed."""

PROBE = """
from rsibr import backend
report = backend.inspect()
if report.device is None:
    raise SystemExit(3)
print("CUDA device" if report.device == "cuda" else "libLLVM " + ".".join(map(str, report.llvm_version)))
"""
"""Run in a process of its own: Dr.Jit looks for libLLVM once a process and remembers the answer."""


def main(env_file: Path) -> None:
    """Write `env_file`, to be sourced before any command that renders.

    Raises
    ------
    MachineError
        If there is no usable libLLVM and no package manager that can install one.
    """
    variable = "DRJIT_LIBLLVM_PATH"
    if found := probe():
        say(found)
        env_file.write_text("# Dr.Jit finds what it needs by itself.\n")
        return
    if os.environ.get(variable):
        raise MachineError(
            f"'{os.environ[variable]}' is no libLLVM {MINIMUM_LLVM} or newer", where=variable, fix="unset it or mend it"
        )
    library = find_elsewhere(env_file.parent)
    if library is None and install(env_file.parent):
        if probe():
            main(env_file)
            return
        library = find_elsewhere(env_file.parent)
    if library is None:
        raise MachineError("no usable libLLVM, and no package manager here could install it", fix=INSTALL_LLVM)
    say(f"{probe(library)} at {library}")
    env_file.write_text(f'[ -n "${{{variable}:-}}" ] || {variable}={shlex.quote(str(library))}\nexport {variable}\n')


def say(line: str) -> None:
    """Print one line of progress."""
    sys.stdout.write(f"backend: {line}\n")
    sys.stdout.flush()


def probe(library: Path | None = None) -> str:
    """Name the device that Dr.Jit can use, with `library` as its libLLVM or with the one that it finds; else ''."""
    environment = os.environ | ({"DRJIT_LIBLLVM_PATH": str(library)} if library else {})
    done = subprocess.run([sys.executable, "-c", PROBE], env=environment, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def find_elsewhere(venv: Path) -> Path | None:
    """Look for a usable libLLVM in the folders that Dr.Jit does not search: Fedora's, conda's and Homebrew's."""
    folders = [
        "/usr/lib64",
        "/usr/lib",
        "/usr/lib/llvm-*/lib",
        "/usr/lib64/llvm*/lib64",
        str(venv.resolve() / "llvm/lib"),
    ]
    folders += ["/opt/homebrew/opt/llvm*/lib", "/usr/local/opt/llvm*/lib", "/home/linuxbrew/.linuxbrew/opt/llvm*/lib"]
    if conda := os.environ.get("CONDA_PREFIX"):
        folders.append(f"{conda}/lib")
    files = {match.resolve() for folder in folders for match in Path("/").glob(f"{folder[1:]}/libLLVM*")}
    return next((file for file in sorted(files, key=_distance) if _could_be_usable(file) and probe(file)), None)


def _version_in(name: str) -> int | None:
    match = re.search(r"(\d+)", name)
    return int(match[1]) if match else None


def _distance(file: Path) -> int:
    version = _version_in(file.name)
    return abs(version - TESTED_LLVM) if version is not None else 0


def _could_be_usable(file: Path) -> bool:
    version = _version_in(file.name)
    return ("so" in file.name.split(".") or file.suffix == ".dylib") and (version is None or version >= MINIMUM_LLVM)


def install(venv: Path) -> bool:
    """Install libLLVM with the first package manager that can; return whether one did."""
    for name, arguments in _offers(venv):
        say(f"installing libLLVM with {name}")
        error = run(arguments)
        if error is None:
            return True
        say(f"{name} failed: {error}")
    return False


def _offers(venv: Path) -> Iterator[tuple[str, Sequence[str]]]:
    """Yield (package manager, its command) in the order in which they are tried."""
    root = _as_root()
    if root is not None and shutil.which("apt-get") and (package := _apt_package(root)):
        yield "apt", [*root, *APT_GET, "install", "--yes", "--no-install-recommends", package]
    if root is not None and shutil.which("dnf"):
        yield "dnf", [*root, "dnf", "install", "--assumeyes", "--quiet", "llvm-libs"]
    if shutil.which("brew"):
        yield "brew", ["brew", "install", "--quiet", "llvm"]
    for conda in filter(shutil.which, ("conda", "mamba", "micromamba")):
        # An environment of its own inside .venv: the user's active one is left as it is.
        prefix = str(venv.resolve() / "llvm")
        yield conda, [conda, "create", "--yes", "--prefix", prefix, "--channel", "conda-forge", f"libllvm{TESTED_LLVM}"]


APT_GET = ("env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "--quiet", "-o", "DPkg::Lock::Timeout=120")


def _as_root() -> tuple[str, ...] | None:
    """Return the prefix that runs a command as root without a password, or None."""
    if os.geteuid() == 0:
        return ()
    return ("sudo", "-n") if shutil.which("sudo") and run(["sudo", "-n", "true"]) is None else None


def _apt_package(root: Sequence[str]) -> str | None:
    """Name the apt package of the libLLVM nearest to the tested one; refresh apt's lists where they have none."""
    package = _best_package(_apt_names())
    if package is None:
        run([*root, *APT_GET, "update"])
        package = _best_package(_apt_names())
    return package


def _apt_names() -> list[str]:
    command = ["apt-cache", "search", "--names-only", "^libllvm[0-9]+(t64)?$"]
    return [
        line.split()[0]
        for line in subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
    ]


def _best_package(names: Sequence[str]) -> str | None:
    usable = {name: version for name in names if (version := _version_in(name)) and version >= MINIMUM_LLVM}
    return min(usable, key=lambda name: abs(usable[name] - TESTED_LLVM), default=None)


def run(command: Sequence[str]) -> str | None:
    """Run `command` quietly; return None where it succeeds, else the last line that it said."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return None
    return next(reversed((done.stdout + done.stderr).strip().splitlines()), f"exit code {done.returncode}")


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]))
    except MachineError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_code)
