"""`rsibr doctor` finds what is missing and outlives it."""

from __future__ import annotations

import builtins
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import rsibr
from rsibr import backend
from rsibr.cli import doctor as module
from rsibr.cli.doctor import diagnose, doctor
from rsibr.errors import MachineError

OLD_LLVM = next(Path("/usr/lib").glob("*/libLLVM-1[456].so"), None)

app = typer.Typer()
app.command()(doctor)


def in_a_fresh_process(*arguments, **environment):
    """Run the command where Dr.Jit has not looked for libLLVM yet."""
    code = "import sys, typer; from rsibr.cli.doctor import doctor; sys.argv[0] = 'doctor'; typer.run(doctor)"
    variables = {key: value for key, value in os.environ.items() if key not in ("RSIBR_DEVICE", "DRJIT_LIBLLVM_PATH")}
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(
        command, env=variables | environment, capture_output=True, text=True, timeout=120, check=False
    )


def test_here_nothing_is_missing():
    result = CliRunner().invoke(app, ["--json"])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["usable"] is True
    assert found["missing"] == []
    assert found["packages"]["rsibr"] == rsibr.__version__
    assert found["backend"]["variant"] == backend.VARIANT_OF[found["backend"]["device"]]
    assert found["kernel"]["seconds"] > 0
    assert found["kernel"]["threads"] >= 1
    assert found["cores"] >= 1
    assert 0 < found["memory"]["available"] <= found["memory"]["total"]
    assert 0 < found["disk"]["available"] <= found["disk"]["total"]


@pytest.mark.skipif(not Path("/proc/self/maps").is_file(), reason="the system does not show what a process has loaded")
@pytest.mark.skipif(not backend.inspect().llvm_version, reason="no libLLVM here")
def test_the_path_is_that_of_the_library_in_the_process():
    path = Path(diagnose().backend["llvm_path"])
    assert path.is_file()
    assert str(path) in Path("/proc/self/maps").read_text()


def test_people_get_a_table_and_a_verdict():
    result = CliRunner().invoke(app, [])
    assert result.exit_code == 0
    for label in ("packages", "variant", "libLLVM", "trial kernel", "kernel cache", "memory", "disk", "ready"):
        assert label in result.stdout


@pytest.mark.parametrize(
    ("library", "complaint"),
    [
        pytest.param(
            str(OLD_LLVM), "too old", marks=pytest.mark.skipif(OLD_LLVM is None, reason="no LLVM 14 to 16 here")
        ),
        ("/nonexistent.so", "finds no libLLVM"),
    ],
)
@pytest.mark.parametrize("as_json", [False, True])
def test_a_libllvm_that_cannot_be_used_is_a_finding_and_no_crash(library, complaint, as_json):
    done = in_a_fresh_process(*["--json"] * as_json, DRJIT_LIBLLVM_PATH=library, RSIBR_DEVICE="llvm")
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr
    if as_json:
        (lack,) = json.loads(done.stdout)["missing"]
        assert complaint in lack["what"]
        assert lack["fix"] == backend.INSTALL_LLVM
    else:
        (line,) = [line for line in done.stdout.splitlines() if line.startswith("missing: ")]
        assert complaint in line
        assert "apt install libllvm19" in line


def test_a_wrong_device_is_the_users_mistake(monkeypatch):
    monkeypatch.setenv("RSIBR_DEVICE", "vulkan")
    diagnosis = diagnose()
    assert diagnosis.exit_code == 2
    assert "'vulkan' is no device" in str(diagnosis.missing[0])
    assert diagnosis.kernel == {}


def test_a_mitsuba_that_cannot_be_imported_is_a_finding(monkeypatch):
    real_import = builtins.__import__

    def refuse(name, *arguments, **keywords):
        if name == "rsibr" and arguments[2] == ("backend",):
            raise ImportError("You are using an incompatible version of `drjit`")
        return real_import(name, *arguments, **keywords)

    monkeypatch.setattr(builtins, "__import__", refuse)
    monkeypatch.setattr(module.metadata, "requires", lambda _: ["mitsuba==3.9.1", "drjit==1.5.0", "numpy>=2"])
    diagnosis = diagnose()
    assert diagnosis.exit_code == 3
    assert "incompatible version of `drjit`" in diagnosis.missing[0].what
    assert diagnosis.missing[0].fix == "run `pip install 'mitsuba==3.9.1' 'drjit==1.5.0'`"


def test_a_kernel_that_kills_its_process_is_a_finding(monkeypatch):
    monkeypatch.setattr(
        module, "TRIAL", "import os, sys; print('LLVM ERROR: Cannot select', file=sys.stderr); os.abort()"
    )
    (lack,) = diagnose().missing
    assert "LLVM ERROR: Cannot select" in lack.what
    assert lack.exit_code == MachineError.exit_code


@pytest.mark.slow
def test_a_file_that_mitsuba_never_finishes_reading_is_a_finding(monkeypatch):
    """As on one core, if the pool were not widened: the child is ended, and the step that hung is named."""
    one_thread = "import drjit; drjit.set_thread_count(1)\n"
    monkeypatch.setattr(module, "TRIAL", one_thread + module.TRIAL.replace("with backend.loading():", "if True:"))
    monkeypatch.setattr(module, "TRIAL_SECONDS", 6.0)
    diagnosis = diagnose()
    (lack,) = diagnosis.missing
    assert lack.what == "a trial OpenEXR file did not end within 6 s"
    assert diagnosis.kernel == {}
    assert diagnosis.exit_code == MachineError.exit_code


def test_one_thread_is_named_with_what_it_hangs():
    plenty = {"total": 2**40, "available": 2**39}
    (line,) = module._advice({"path": "/nowhere/yet"}, plenty, plenty, 1)
    assert "dr.set_thread_count(2)" in line
    assert list(module._advice({"path": "/nowhere/yet"}, plenty, plenty, 2)) == []


def test_the_cache_is_looked_for_where_drjit_looks(monkeypatch, tmp_path):
    (tmp_path / "kernel.bin").write_bytes(bytes(1000))
    monkeypatch.setenv("DRJIT_CACHE_DIR", str(tmp_path))
    assert module._kernel_cache() == {"path": str(tmp_path), "bytes": 1000}
    monkeypatch.delenv("DRJIT_CACHE_DIR")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert module._kernel_cache()["path"] == str(tmp_path / ".drjit")
    monkeypatch.delenv("HOME")
    assert module._kernel_cache() == {"path": None, "bytes": 0}


def test_scarce_memory_and_disk_and_a_lost_cache_are_advice():
    plenty, scarce = {"total": 2**40, "available": 2**39}, {"total": 2**30, "available": 2**20}
    assert list(module._advice({"path": "/nowhere/yet"}, plenty, plenty, 2)) == []
    advice = list(module._advice({"path": None}, scarce, scarce, 2))
    assert len(advice) == 3
    for line, word in zip(advice, ("DRJIT_CACHE_DIR", "memory", "disk"), strict=True):
        assert word in line
