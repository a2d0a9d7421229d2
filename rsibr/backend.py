"""Selection, check and restoration of the Mitsuba variant; the only module that sets it.

A variant combines a device with the quantity carried along a path: linear RGB, radiance at sampled wavelengths, or
Mueller matrices at sampled wavelengths. Everything runs in RGB except inside a `rendering` block.

The variant is global to the process and shared by all threads (`mi.set_variant` replaces the contents of the module
`mitsuba`). It belongs to the user: every public function works in a `session`, which restores the user's variant.
Mitsuba objects remain usable while another variant is set, because each refers to its own classes; only names looked up
in the module (`mi.Float`, `mi.load_dict`) change.

One thread at a time is in a session; others wait for their turn. Tracing of kernels is not thread-safe: eight threads
that reconstruct at once hang, or end the process without a message.

Mitsuba decodes OpenEXR with tasks of Dr.Jit's thread pool, which nobody runs if the pool has one thread, as on a
machine with one core. Whatever may read files is loaded by `load`, or in a `loading` block.

Mitsuba and Dr.Jit fall back silently (CUDA to LLVM to scalar), and a libLLVM older than 17 aborts the process during a
render. This module checks the backend before the first kernel, and raises an error that says how to fix what is
missing.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from functools import partial, wraps
from inspect import isgeneratorfunction
from threading import RLock, local
from typing import Any, Literal, ParamSpec, TypeVar, cast

import drjit as dr
import mitsuba as mi

from rsibr import clock
from rsibr.errors import InputError, MachineError

Device = Literal["cuda", "llvm"]

Rendering = Literal["rgb", "spectral", "spectral_polarized"]
"""Quantity carried along a path. Mitsuba has no polarised RGB; polarisation requires spectral rendering."""

MINIMUM_LLVM = 17
"""Dr.Jit 1.5 emits `llvm.maximum`, which LLVM 14, 15 and 16 cannot select on x86: the process aborts."""

VARIANT_OF: dict[Device, str] = {"cuda": "cuda_ad_rgb", "llvm": "llvm_ad_rgb"}
"""Mitsuba's RGB variant for each device. Both render scene-linear Rec.709 in float32."""

FEWEST_THREADS = 2
"""Least size of Dr.Jit's thread pool at which Mitsuba reads and writes OpenEXR; a pool of one thread waits forever."""

INSTALL_LLVM = (
    "install libLLVM 19: `apt install libllvm19` (Debian, Ubuntu), `dnf install llvm-libs` (Fedora), "
    "`brew install llvm` (macOS), `conda install -c conda-forge libllvm19` (any system), "
    "or point DRJIT_LIBLLVM_PATH at the library"
)

_rendering: ContextVar[Rendering] = ContextVar("rendering", default="rgb")

_choices: dict[tuple[Device | None, str, Rendering], str] = {}
"""Cached variant by device, value of `RSIBR_DEVICE`, and rendering."""

_registrations: list[Callable[[], None]] = []
_registered: dict[str, int] = {}
"""Number of `_registrations` that have been called, by variant."""


_turn = RLock()
"""Held by the thread that is in a session."""

_own = local()
"""`depth`: number of nested sessions of this thread."""

_P = ParamSpec("_P")
_R = TypeVar("_R")


@dataclass(frozen=True)
class BackendReport:
    """Devices and libraries available to Dr.Jit, as shown by `rsibr doctor`.

    Attributes
    ----------
    cuda : bool
        Whether a CUDA device works.
    llvm_version : tuple of int or None
        Version of the libLLVM that Dr.Jit loads; None if it finds none.
    llvm_path : str or None
        Value of `DRJIT_LIBLLVM_PATH`; None if it is unset and Dr.Jit searches by itself.
    """

    cuda: bool
    llvm_version: tuple[int, int, int] | None
    llvm_path: str | None

    @property
    def llvm_usable(self) -> bool:
        """Whether libLLVM is found, and new enough to run a kernel without aborting the process."""
        return self.llvm_version is not None and self.llvm_version[0] >= MINIMUM_LLVM

    @property
    def device(self) -> Device | None:
        """Device that `use()` selects; None if neither is usable."""
        if self.cuda:
            return "cuda"
        return "llvm" if self.llvm_usable else None


def inspect() -> BackendReport:
    """Report devices and libraries, without compiling a kernel or setting a variant."""
    has_llvm = dr.has_backend(dr.JitBackend.LLVM)
    return BackendReport(
        cuda=bool(dr.has_backend(dr.JitBackend.CUDA)),
        llvm_version=tuple(dr.detail.llvm_version()) if has_llvm else None,
        llvm_path=os.environ.get("DRJIT_LIBLLVM_PATH"),
    )


def use(device: Device | None = None) -> str:
    """Set the Mitsuba variant for `device`, or for the best usable device.

    Inside a `rendering` block the variant of that rendering is set, otherwise RGB. The environment variable
    `RSIBR_DEVICE` (`cuda` or `llvm`) gives the default of `device`.

    Parameters
    ----------
    device : {"cuda", "llvm"}, optional
        Required device. By default CUDA if a device works, otherwise LLVM.

    Returns
    -------
    str
        Name of the variant now set, for example `"llvm_ad_rgb"`.

    Raises
    ------
    InputError
        If `RSIBR_DEVICE` does not name a known device.
    MachineError
        If the device does not work, or libLLVM is missing or older than `MINIMUM_LLVM`. There is no fallback.
    """
    variant = _chosen(device)
    if mi.variant() != variant:
        mi.set_variant(variant)
    if _registered.get(variant) != len(_registrations):
        _register_plugins(variant)
    clock.note_ready()
    return variant


class session:  # noqa: N801  # named like the context managers of contextlib; faster than a generator
    """Context manager that sets rsibr's variant, and restores the user's variant at its end or after an exception.

    Sessions nest. A session takes a few microseconds if the variant is set already; a change of variant takes 0.05 s. A
    session inside another one, or inside a `rendering` block, keeps the current device and rendering.

    `with session() as variant` gives the name of the variant now set, for example `"llvm_ad_rgb"`.

    Raises
    ------
    InputError, MachineError
        As `use`. The variant is then unchanged.

    Notes
    -----
    Mitsuba cannot return to the state without a variant. If none was set before, rsibr's RGB variant remains. No object
    of the user can depend on the former state, and a later `mi.set_variant` of the user works as usual.

    Sessions of several threads run one after another, and each thread waits for its turn: the result is that of serial
    calls. Callbacks of the user are called in rsibr's variant; those wrapped by `unlocked` let other threads work
    meanwhile. A thread that uses Mitsuba outside of sessions at the same time, in another variant, needs its own
    process.

    Examples
    --------
    >>> import mitsuba as mi
    >>> before = mi.variant()
    >>> with session() as variant:
    ...     assert mi.variant() == variant
    >>> mi.variant() in (before, variant)
    True
    """

    __slots__ = ("_before",)

    def __enter__(self) -> str:
        self._before, is_nested = _enter()
        try:
            return use(_device_in_use() if is_nested else None)
        except BaseException:
            _leave(self._before)
            raise

    def __exit__(self, *_: object) -> None:
        _leave(self._before)


def in_session(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate a function so that every call runs in a `session`; name, signature and docstring are preserved.

    For a generator function each step is a separate session: between the steps the user's variant is set.
    """
    if isgeneratorfunction(function):
        return cast("Callable[_P, _R]", _stepwise(function))

    @wraps(function)
    def within(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        with session():
            return function(*args, **kwargs)

    return within


@contextmanager
def rendering(kind: Rendering) -> Iterator[str]:
    """Set the variant of a rendering on the current device inside the block, and restore the previous one afterwards.

    Mitsuba objects belong to the variant in which they were made: make scenes and BSDFs inside the block, and use them
    in blocks of the same kind. Arrays and vectors are shared by all variants. The notes of `session` on threads and on
    processes without a variant apply.

    Parameters
    ----------
    kind : {"rgb", "spectral", "spectral_polarized"}
        Quantity carried along a path.

    Yields
    ------
    str
        Name of the variant now set, for example `"llvm_ad_spectral"`.

    Raises
    ------
    InputError, MachineError
        As `use`; also if Mitsuba was built without the variant.
    """
    outer = _rendering.set(kind)
    before, _ = _enter()
    try:
        yield use(_device_in_use())
    finally:
        _rendering.reset(outer)
        _leave(before)


def unlocked(callback: Callable[_P, _R]) -> Callable[_P, _R]:
    """Wrap a callback of the user so that sessions of other threads may run during its calls.

    A callback that waits for a thread which calls rsibr would otherwise wait forever. After the callback, this thread
    waits for its turn, and the variant is that of before.
    """

    @wraps(callback)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        depth, variant = _depth(), mi.variant()
        for _ in range(depth):
            _turn.release()
        try:
            return callback(*args, **kwargs)
        finally:
            _wait_for_turns(depth)
            if depth:
                _set_back(variant)

    return call


@contextmanager
def loading() -> Iterator[None]:
    """Give Dr.Jit's pool at least `FEWEST_THREADS` threads inside the block: required wherever Mitsuba may read a file.

    The pool of before is restored, because a second thread on one core slows small kernels by a third.
    """
    threads = dr.thread_count()
    if threads >= FEWEST_THREADS:
        yield
        return
    dr.set_thread_count(FEWEST_THREADS)
    try:
        yield
    finally:
        dr.set_thread_count(threads)


def load(plugin: dict[str, Any]) -> Any:
    """Load a Mitsuba object from plain data, as `mi.load_dict`, on machines with a single core as well.

    Parameters
    ----------
    plugin : dict
        Plugin with its nested objects.

    Returns
    -------
    mi.Object
        In the current variant.

    Notes
    -----
    Not in parallel: two Python plugins that are instantiated at once end the process without a message.
    """
    with loading():
        return mi.load_dict(plugin, parallel=False)


def current_rendering() -> Rendering:
    """Return the rendering of the current `rendering` block; "rgb" outside of any."""
    return _rendering.get()


def variant_name(device: Device, kind: Rendering) -> str:
    """Return Mitsuba's name of a variant.

    Raises
    ------
    MachineError
        If Mitsuba was built without it.
    """
    name = f"{device}_ad_{kind}"
    if name not in mi.variants():
        raise MachineError(f"this Mitsuba has no variant {name}", fix="install the mitsuba of requirements.lock")
    return name


def on_variant(register: Callable[[], None]) -> Callable[[], None]:
    """Call `register` once for each variant that `use` sets, because Mitsuba registers plugins per variant."""
    _registrations.append(register)
    return register


def synchronize() -> None:
    """Wait until the device has finished; required at the end of timed regions, because kernels are asynchronous."""
    dr.sync_thread()


def _chosen(device: Device | None) -> str:
    key = (device, os.environ.get("RSIBR_DEVICE", ""), _rendering.get())
    if key not in _choices:
        _choices[key] = variant_name(_working_device(device or _device_from_environment()), _rendering.get())
    return _choices[key]


def _register_plugins(variant: str) -> None:
    for register in _registrations[_registered.get(variant, 0) :]:
        register()
        _registered[variant] = _registered.get(variant, 0) + 1


def _enter() -> tuple[str | None, bool]:
    """Wait for this thread's turn; return the current variant, and whether this thread is in a session already."""
    _turn.acquire()
    depth = _depth()
    _own.depth = depth + 1
    return mi.variant(), depth > 0


def _leave(before: str | None) -> None:
    """Restore the variant before the session, and let the next thread in after the outermost one."""
    try:
        _set_back(before)
    finally:
        _own.depth -= 1
        _turn.release()


def _depth() -> int:
    depth: int = getattr(_own, "depth", 0)
    return depth


def _wait_for_turns(count: int) -> None:
    """Take the lock `count` times. An interruption is raised only afterwards, so that each session can give it back."""
    interruption: BaseException | None = None
    while count:
        try:
            _turn.acquire()
            count -= 1
        except BaseException as error:  # Ctrl-C while waiting
            interruption = error
    if interruption is not None:
        raise interruption


def _set_back(variant: str | None) -> None:
    if variant is not None and mi.variant() != variant:
        mi.set_variant(variant)
    if variant is None and mi.variant() is not None:
        use(_device_in_use())  # RGB remains, not a spectral variant


def _stepwise(function: Callable[..., Generator[Any, Any, Any]]) -> Callable[..., Generator[Any, Any, Any]]:
    """Wrap a generator function so that its `rendering` blocks do not affect the code that iterates over it."""

    @wraps(function)
    def steps(*args: Any, **kwargs: Any) -> Generator[Any, Any, Any]:
        generator, context = function(*args, **kwargs), copy_context()
        step: Callable[[], Any] = partial(next, generator)
        try:
            while True:
                try:
                    item = context.run(_in_own_session, step)
                except StopIteration as end:
                    return end.value
                try:
                    step = partial(generator.send, (yield item))
                except Exception as error:  # thrown into the generator by its caller
                    step = partial(generator.throw, error)
        finally:
            context.run(_in_own_session, generator.close)

    return steps


def _in_own_session(step: Callable[[], _R]) -> _R:
    with session():
        return step()


def _device_in_use() -> Device | None:
    """Device of the current variant; None if no variant is set."""
    device = (mi.variant() or "").partition("_ad_")[0]
    return device if device in VARIANT_OF else None


def _device_from_environment() -> Device | None:
    name = os.environ.get("RSIBR_DEVICE", "")
    if name not in ("", *VARIANT_OF):
        raise InputError(
            f"'{name}' is no device", where="RSIBR_DEVICE", fix=f"use one of: {', '.join(VARIANT_OF)}, or unset it"
        )
    return name or None  # type: ignore[return-value]  # checked above


def _working_device(wanted: Device | None) -> Device:
    report = inspect()
    if wanted == "cuda" and not report.cuda:
        raise MachineError("no CUDA device works here", fix="check the NVIDIA driver, or use the llvm device")
    if wanted == "cuda" or (wanted is None and report.cuda):
        return "cuda"
    if report.llvm_version is None:
        raise MachineError(f"Dr.Jit finds no libLLVM on this {platform.system()} machine", fix=INSTALL_LLVM)
    if not report.llvm_usable:
        found = ".".join(map(str, report.llvm_version))
        raise MachineError(
            f"libLLVM {found} is too old: Dr.Jit needs {MINIMUM_LLVM} or newer and would abort the process",
            fix=INSTALL_LLVM,
        )
    return "llvm"
