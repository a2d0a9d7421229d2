"""The backend refuses what would crash or fall back, and sets one variant."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import pytest

from rsibr import backend
from rsibr.backend import BackendReport
from rsibr.errors import InputError, MachineError

OLD_LLVM = next(Path("/usr/lib").glob("*/libLLVM-1[456].so"), None)


def pretend(monkeypatch, *, cuda=False, llvm=None):
    """Let the machine offer this and nothing else, and record the variant that would be set."""
    variants = []
    monkeypatch.setattr(backend, "inspect", lambda: BackendReport(cuda, llvm, None))
    monkeypatch.setattr(mi, "set_variant", variants.append)
    monkeypatch.setattr(mi, "variant", lambda: variants[-1] if variants else None)
    monkeypatch.setattr(backend, "_registrations", [])
    monkeypatch.setattr(backend, "_registered_variants", set())
    monkeypatch.delenv("RSIBR_DEVICE", raising=False)
    return variants


def in_a_fresh_process(code, **environment):
    variables = {key: value for key, value in os.environ.items() if key not in ("RSIBR_DEVICE", "DRJIT_LIBLLVM_PATH")}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, env=variables | environment, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize(
    ("cuda", "llvm", "device"),
    [
        (False, None, None),
        (False, (14, 0, 6), None),
        (False, (16, 0, 6), None),
        (False, (17, 0, 0), "llvm"),
        (False, (19, 1, 7), "llvm"),
        (True, None, "cuda"),
        (True, (15, 0, 7), "cuda"),
    ],
)
def test_the_report_names_the_device_that_use_picks(cuda, llvm, device, monkeypatch):
    variants = pretend(monkeypatch, cuda=cuda, llvm=llvm)
    assert backend.inspect().device == device
    if device is None:
        with pytest.raises(MachineError):
            backend.use()
        assert variants == []
    else:
        assert backend.use() == backend.VARIANT_OF[device]
        assert variants == [backend.VARIANT_OF[device]]


@pytest.mark.parametrize("version", [(14, 0, 6), (15, 0, 7), (16, 0, 6)])
def test_an_llvm_that_would_abort_is_refused_with_its_version_and_a_remedy(version, monkeypatch):
    variants = pretend(monkeypatch, llvm=version)
    with pytest.raises(MachineError) as caught:
        backend.use()
    line = str(caught.value)
    assert ".".join(map(str, version)) in line
    for manager in ("apt install", "dnf install", "brew install", "conda install"):
        assert manager in line
    assert variants == []


def test_cuda_is_never_replaced_by_llvm_in_silence(monkeypatch):
    variants = pretend(monkeypatch, llvm=(19, 1, 7))
    with pytest.raises(MachineError, match="no CUDA device"):
        backend.use("cuda")
    monkeypatch.setenv("RSIBR_DEVICE", "cuda")
    with pytest.raises(MachineError, match="no CUDA device"):
        backend.use()
    assert variants == []


def test_llvm_is_never_replaced_by_cuda_in_silence(monkeypatch):
    variants = pretend(monkeypatch, cuda=True)
    with pytest.raises(MachineError, match="libLLVM"):
        backend.use("llvm")
    assert variants == []


def test_an_argument_outranks_the_environment(monkeypatch):
    variants = pretend(monkeypatch, cuda=True, llvm=(19, 1, 7))
    monkeypatch.setenv("RSIBR_DEVICE", "cuda")
    assert backend.use("llvm") == "llvm_ad_rgb"
    assert variants == ["llvm_ad_rgb"]


def test_an_unknown_device_names_the_variable_and_the_choices(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    monkeypatch.setenv("RSIBR_DEVICE", "vulkan")
    with pytest.raises(InputError, match=r"^RSIBR_DEVICE: 'vulkan' is no device\. Use one of: cuda, llvm"):
        backend.use()


def test_plugins_are_registered_once_for_each_variant(monkeypatch):
    variants = pretend(monkeypatch, cuda=True, llvm=(19, 1, 7))
    registered = []
    backend.on_variant(lambda: registered.append(variants[-1]))
    for device in ("llvm", "llvm", "cuda", "llvm", "cuda"):
        backend.use(device)
    assert registered == ["llvm_ad_rgb", "cuda_ad_rgb"]
    assert variants == ["llvm_ad_rgb", "cuda_ad_rgb", "llvm_ad_rgb", "cuda_ad_rgb"]


def test_a_plugin_that_comes_late_is_registered_at_the_next_use(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    backend.use()
    registered = []
    backend.on_variant(lambda: registered.append("late"))
    backend.use()
    assert registered == ["late"]


def test_a_block_renders_otherwise_and_gives_back_what_was_set(monkeypatch):
    variants = pretend(monkeypatch, cuda=True, llvm=(19, 1, 7))
    backend.use("llvm")
    with backend.rendering("spectral") as variant:
        assert variant == mi.variant() == "llvm_ad_spectral"  # on the device in use, though another would do
        assert backend.use("llvm") == "llvm_ad_spectral"  # who asks for a backend inside gets that of the block
        with backend.rendering("spectral_polarized"):
            assert mi.variant() == "llvm_ad_spectral_polarized"
        assert mi.variant() == "llvm_ad_spectral"
    assert mi.variant() == "llvm_ad_rgb"
    assert variants[-1] == "llvm_ad_rgb"


def test_a_block_that_fails_gives_back_what_was_set_too(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    with pytest.raises(ZeroDivisionError), backend.rendering("spectral"):
        raise ZeroDivisionError
    assert backend.current_rendering() == "rgb"
    assert mi.variant() == "llvm_ad_rgb"


def test_a_mitsuba_without_the_variant_is_said(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    monkeypatch.setattr(mi, "variants", lambda: ["llvm_ad_rgb"])
    with pytest.raises(MachineError, match="no variant llvm_ad_spectral"), backend.rendering("spectral"):
        pass
    assert mi.variant() == "llvm_ad_rgb"


def test_importing_rsibr_sets_no_variant():
    done = in_a_fresh_process("import mitsuba as mi, rsibr.backend; print(mi.variant())")
    assert done.stdout.split() == ["None"]


def test_a_kernel_runs_here_in_the_variant_that_use_names():
    done = in_a_fresh_process(
        "from rsibr import backend; import mitsuba as mi, drjit as dr\n"
        "print(backend.use(), mi.variant(), dr.max(dr.maximum(mi.Float([1, 2, 3]), 2.5))[0])"
    )
    assert done.returncode == 0, done.stderr
    named, current, largest = done.stdout.split()
    assert named == current
    assert float(largest) == 3


REFUSE = """
from rsibr import backend
from rsibr.errors import MachineError
try:
    backend.use("llvm")
except MachineError as error:
    print(error)
    raise SystemExit(error.exit_code)
"""


@pytest.mark.skipif(OLD_LLVM is None, reason="no LLVM 14 to 16 here")
def test_a_real_old_llvm_is_refused_before_it_aborts_the_process():
    done = in_a_fresh_process(REFUSE, DRJIT_LIBLLVM_PATH=str(OLD_LLVM))
    assert done.returncode == 3, done.stderr
    assert "too old" in done.stdout
    assert "Traceback" not in done.stderr


def test_an_absent_llvm_is_refused_with_one_line():
    done = in_a_fresh_process(REFUSE, DRJIT_LIBLLVM_PATH="/nonexistent.so")
    assert done.returncode == 3, done.stderr
    assert "finds no libLLVM" in done.stdout
    assert len(done.stdout.splitlines()) == 1
    assert "Traceback" not in done.stderr
