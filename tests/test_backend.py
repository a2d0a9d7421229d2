"""The backend refuses what would crash or fall back, and sets one variant."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import threading
import timeit
from concurrent.futures import ThreadPoolExecutor
from inspect import signature
from pathlib import Path

import drjit as dr
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
    monkeypatch.setattr(backend, "_registered", {})
    monkeypatch.setattr(backend, "_choices", {})
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
    assert mi.variant() is None


@pytest.mark.parametrize("users", ["scalar_rgb", "llvm_ad_spectral", "llvm_ad_rgb"])
def test_a_session_gives_back_the_users_variant(users, monkeypatch):
    variants = pretend(monkeypatch, llvm=(19, 1, 7))
    mi.set_variant(users)
    with backend.session() as variant:
        assert variant == mi.variant() == "llvm_ad_rgb"
        with backend.session(), backend.rendering("spectral"), backend.session() as inner:
            assert inner == mi.variant() == "llvm_ad_spectral"
        assert mi.variant() == "llvm_ad_rgb"
    assert mi.variant() == users
    changes = len(variants)
    with pytest.raises(ZeroDivisionError), backend.session():
        raise ZeroDivisionError
    assert mi.variant() == users
    assert (len(variants) == changes) == (users == "llvm_ad_rgb")  # what is set already is not set again


def test_a_session_keeps_the_device_in_use(monkeypatch):
    pretend(monkeypatch, cuda=True, llvm=(19, 1, 7))
    with backend.session():
        assert mi.variant() == "cuda_ad_rgb"
        backend.use("llvm")
        with backend.session():
            assert mi.variant() == "llvm_ad_rgb"
    mi.set_variant("scalar_rgb")
    with backend.rendering("spectral"), backend.session():
        assert mi.variant() == "cuda_ad_spectral"
    assert mi.variant() == "scalar_rgb"


def test_a_session_that_cannot_begin_leaves_the_variant(monkeypatch):
    pretend(monkeypatch)
    mi.set_variant("scalar_rgb")
    for _ in range(2):  # and is left, so that the next one is the outermost again
        with pytest.raises(MachineError, match="libLLVM"), backend.session():
            pass
        assert mi.variant() == "scalar_rgb"


def test_after_no_variant_no_spectral_one_stays(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    with backend.rendering("spectral"):
        assert mi.variant() == "llvm_ad_spectral"
    assert mi.variant() == "llvm_ad_rgb"


def test_a_callback_that_sets_a_variant_finds_it_after_a_session_of_its_own(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    mi.set_variant("scalar_spectral")
    with backend.session():
        mi.set_variant("scalar_rgb")
        with backend.session():
            assert mi.variant() == "llvm_ad_rgb"
        assert mi.variant() == "scalar_rgb"
    assert mi.variant() == "scalar_spectral"


def test_threads_wait_for_their_turn_and_each_finds_the_users_variant(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    mi.set_variant("scalar_rgb")
    order, started = [], threading.Event()

    def work():
        started.set()
        with backend.rendering("spectral"):
            order.append(mi.variant())

    worker = threading.Thread(target=work)
    with backend.session():
        worker.start()
        assert started.wait(10)
        worker.join(0.1)  # time to come in, if it could
        order.append(mi.variant())
    worker.join(10)
    assert order == ["llvm_ad_rgb", "llvm_ad_spectral"]
    assert mi.variant() == "scalar_rgb"


def test_a_session_that_fails_lets_the_next_thread_in(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    with pytest.raises(ZeroDivisionError), backend.session(), backend.rendering("spectral"):
        raise ZeroDivisionError
    with ThreadPoolExecutor(1) as others:
        assert others.submit(backend.in_session(mi.variant)).result(timeout=10) == "llvm_ad_rgb"


def test_another_thread_works_while_a_callback_waits_for_it(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    mi.set_variant("scalar_rgb")
    with ThreadPoolExecutor(1) as others:

        @backend.unlocked
        def callback():
            nested = backend.in_session(mi.variant)
            return mi.variant(), nested(), others.submit(nested).result(timeout=10)

        with backend.session(), backend.rendering("spectral"):
            # The other thread is in no block of this one: its rendering is RGB
            assert callback() == ("llvm_ad_spectral", "llvm_ad_spectral", "llvm_ad_rgb")
            assert mi.variant() == "llvm_ad_spectral"
            with pytest.raises(ZeroDivisionError):
                backend.unlocked(lambda: 1 / 0)()
            outsider = others.submit(backend.in_session(mi.variant))
            with pytest.raises(TimeoutError):  # locked again
                outsider.result(timeout=0.1)
        assert outsider.result(timeout=10) == "llvm_ad_rgb"
    assert mi.variant() == "scalar_rgb"


@pytest.mark.parametrize("users", [1, 2, 3])
def test_files_are_loaded_with_two_threads_and_the_users_pool_comes_back(users):
    before = dr.thread_count()
    try:
        dr.set_thread_count(users)
        with backend.loading(), backend.loading():
            assert dr.thread_count() == max(users, backend.FEWEST_THREADS)
        assert dr.thread_count() == users
    finally:
        dr.set_thread_count(before)


LOADS = ("load_dict", "load_file", "load_string", "instantiate", "Bitmap")


def test_whatever_reads_files_through_mitsuba_is_in_a_loading_block():
    """`mi.load_dict` only in `backend.load`; what remains stands in a `with` statement that names `loading`."""
    package = Path(backend.__file__).parent
    for file in package.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        safe = {
            id(node)
            for block in ast.walk(tree)
            if isinstance(block, ast.With) and any("loading()" in ast.unparse(item) for item in block.items)
            for node in ast.walk(block)
        }
        for node in ast.walk(tree):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in LOADS):
                continue
            of_array = node.func.attr == "Bitmap" and "image" in ast.unparse(node.args[0])  # reads no file
            if ast.unparse(node.func).startswith("mi.") and not of_array:
                assert id(node) in safe, f"{file.name}:{node.lineno}: use backend.load or a backend.loading block"


def test_a_decorated_function_stays_itself_and_works_in_a_session(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    mi.set_variant("scalar_rgb")

    @backend.in_session
    def scaled(x: float, *, by: float = 2.0) -> tuple[float, str]:
        """Scale."""
        return x / (1 / by), mi.variant()

    assert scaled(3.0) == (6.0, "llvm_ad_rgb")
    assert str(signature(scaled)) == "(x: 'float', *, by: 'float' = 2.0) -> 'tuple[float, str]'"
    assert (scaled.__doc__, scaled.__name__, scaled.__module__) == ("Scale.", "scaled", __name__)
    with pytest.raises(ZeroDivisionError):
        scaled(1.0, by=0.0)
    assert mi.variant() == "scalar_rgb"


def test_between_the_steps_of_a_generator_the_users_variant_is_set(monkeypatch):
    pretend(monkeypatch, llvm=(19, 1, 7))
    mi.set_variant("scalar_rgb")
    ended = []

    @backend.in_session
    def steps():
        try:
            with backend.rendering("spectral"):
                sent = yield mi.variant()
                try:
                    yield sent, mi.variant()
                except KeyError:
                    yield "caught", mi.variant()
            yield mi.variant()
        finally:
            ended.append(mi.variant())

    def at_rest():
        assert mi.variant() == "scalar_rgb"
        assert backend.current_rendering() == "rgb"

    generator = steps()
    at_rest()
    assert next(generator) == "llvm_ad_spectral"
    at_rest()
    assert generator.send(7) == (7, "llvm_ad_spectral")
    at_rest()
    assert generator.throw(KeyError()) == ("caught", "llvm_ad_spectral")
    assert next(generator) == "llvm_ad_rgb"
    at_rest()
    generator.close()
    assert ended == ["llvm_ad_rgb"]
    at_rest()
    assert next(iter(list(steps()))) == "llvm_ad_spectral"
    at_rest()


def test_a_session_takes_next_to_no_time_where_the_variant_is_right():
    backend.use()

    def once():
        with backend.session():
            pass

    assert min(timeit.repeat(once, number=1000, repeat=20)) / 1000 < 50e-6  # 4 on a quiet machine


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
