"""The set-up's search for libLLVM: what it asks for, of whom, and what it says where nobody can help."""

from __future__ import annotations

import importlib.util
import os
import subprocess
from pathlib import Path

import pytest

from rsibr.errors import MachineError

SCRIPT = Path(__file__).parents[1] / "scripts" / "ensure_llvm.py"


def load():
    """Import the script, which is no part of the package."""
    specification = importlib.util.spec_from_file_location("ensure_llvm", SCRIPT)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture
def script(monkeypatch):
    """Load the script for an ordinary user on a machine with no libLLVM and no package manager."""
    module = load()
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(module, "probe", lambda _library=None: "")
    return module


@pytest.fixture
def programs(tmp_path, monkeypatch):
    """Stand-ins for programs, the only ones on the path; each records its call."""
    folder = tmp_path / "bin"
    folder.mkdir()
    log = tmp_path / "calls"
    log.touch()
    monkeypatch.setenv("PATH", str(folder))

    def add(name, body="", status=0):
        (folder / name).write_text(f'#!/bin/sh\necho "{name} $*" >> {log}\n{body}\nexit {status}\n')
        (folder / name).chmod(0o755)

    add.calls = lambda: log.read_text().splitlines()
    add.root = lambda: monkeypatch.setattr(os, "geteuid", lambda: 0)
    (folder / "env").symlink_to("/usr/bin/env")
    return add


def test_nothing_is_installed_where_drjit_finds_a_library(script, programs, tmp_path, monkeypatch, capsys):
    programs("conda")
    monkeypatch.setattr(script, "probe", lambda _library=None: "libLLVM 19.1.7")
    script.main(tmp_path / "llvm.env")
    assert programs.calls() == []
    assert capsys.readouterr().out == "backend: libLLVM 19.1.7\n"
    assert "DRJIT_LIBLLVM_PATH" not in (tmp_path / "llvm.env").read_text()


def test_where_nobody_can_help_one_line_names_four_commands(script, programs, tmp_path, monkeypatch):
    monkeypatch.setattr(script, "find_elsewhere", lambda _venv: None)
    with pytest.raises(MachineError) as caught:
        script.main(tmp_path / "llvm.env")
    line = str(caught.value)
    assert "\n" not in line
    for command in ("apt install libllvm19", "dnf install llvm-libs", "brew install llvm", "conda install"):
        assert command in line
    assert not (tmp_path / "llvm.env").exists()
    assert programs.calls() == []


def test_a_library_that_the_user_named_is_never_replaced_in_silence(script, programs, tmp_path, monkeypatch):
    programs("conda")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/opt/llvm 15/libLLVM.so")
    with pytest.raises(MachineError, match=r"^DRJIT_LIBLLVM_PATH: '/opt/llvm 15/libLLVM\.so'"):
        script.main(tmp_path / "llvm.env")
    assert programs.calls() == []


def test_apt_installs_the_version_nearest_to_the_tested_one(script, programs, tmp_path):
    programs.root()
    programs("apt-cache", "for v in 14 15 16 17t64 18 20 22; do echo libllvm$v - a library; done")
    programs("apt-get")
    assert script.install(tmp_path)
    (install,) = [call for call in programs.calls() if call.startswith("apt-get")]
    assert install.endswith("install --yes --no-install-recommends libllvm18")


def test_apts_lists_are_refreshed_where_they_offer_nothing(script, programs, tmp_path):
    fresh = tmp_path / "fresh"
    programs.root()
    programs("apt-cache", f"[ -f {fresh} ] && echo libllvm19 - a library; echo libllvm15 - a library")
    programs("apt-get", f"case $* in *update) : > {fresh};; esac")
    assert script.install(tmp_path)
    update, install = [call for call in programs.calls() if call.startswith("apt-get")]
    assert update.endswith("update")
    assert install.endswith("libllvm19")


def test_without_root_apt_is_asked_through_sudo_and_only_without_a_password(script, programs, tmp_path):
    programs("apt-cache", "echo libllvm19 - a library")
    programs("apt-get")
    programs("sudo", status=1)
    assert not script.install(tmp_path)
    assert programs.calls() == ["sudo -n true"]
    programs("sudo")
    assert script.install(tmp_path)
    assert programs.calls()[-1].startswith("sudo -n env DEBIAN_FRONTEND=noninteractive apt-get")


def test_a_manager_that_fails_says_why_and_the_next_is_asked(script, programs, tmp_path, capsys):
    programs("brew", "echo no network >&2", status=1)
    programs("conda")
    assert script.install(tmp_path)
    assert [call.split()[0] for call in programs.calls()] == ["brew", "conda"]
    assert "backend: brew failed: no network" in capsys.readouterr().out


def test_conda_gets_an_environment_of_its_own(script, programs, tmp_path, monkeypatch):
    monkeypatch.setenv("CONDA_PREFIX", "/home/someone/work")
    programs("conda")
    assert script.install(tmp_path)
    assert f"--prefix {tmp_path}/llvm" in programs.calls()[0]


def test_a_library_elsewhere_is_named_to_the_shell_unless_the_user_names_another(script, tmp_path, monkeypatch):
    folder = tmp_path / "my conda" / "lib"
    folder.mkdir(parents=True)
    for name in ("libLLVM-15.so", "libLLVM.so.19.1", "libLLVM-C.a"):
        (folder / name).touch()
    monkeypatch.setenv("CONDA_PREFIX", str(folder.parent))
    library = folder / "libLLVM.so.19.1"
    monkeypatch.setattr(script, "probe", lambda path=None: "libLLVM 19.1.0" if path == library else "")
    script.main(tmp_path / "llvm.env")
    command = f'. "{tmp_path}/llvm.env" && /usr/bin/env | grep ^DRJIT_LIBLLVM_PATH='
    shell = subprocess.run(["/bin/sh", "-c", command], capture_output=True, text=True, check=True)
    assert shell.stdout == f"DRJIT_LIBLLVM_PATH={library}\n"
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/mine.so")
    shell = subprocess.run(["/bin/sh", "-c", command], capture_output=True, text=True, check=True)
    assert shell.stdout == "DRJIT_LIBLLVM_PATH=/mine.so\n"


def test_a_library_too_old_by_its_name_is_not_even_loaded(script, tmp_path, monkeypatch):
    (tmp_path / "lib").mkdir()
    for name in ("libLLVM-14.so", "libLLVM.so.16", "libLLVM-19.so", "libLLVM.dylib", "libLLVM-19.a"):
        (tmp_path / "lib" / name).touch()
    tried = []
    monkeypatch.setenv("CONDA_PREFIX", str(tmp_path))
    monkeypatch.setattr(script, "probe", lambda path=None: tried.append(path) or "")
    assert script.find_elsewhere(tmp_path / ".venv") is None
    ours = {path.name for path in tried if path.is_relative_to(tmp_path)}
    assert ours == {"libLLVM-19.so", "libLLVM.dylib"}


def test_the_probe_takes_the_library_that_it_is_given():
    script = load()
    found = script.probe()
    assert found.startswith(("libLLVM ", "CUDA device"))
    # A process of its own each time: Dr.Jit in this one has made up its mind.
    assert script.probe(Path("/nonexistent.so")) == ("" if found.startswith("libLLVM") else found)
