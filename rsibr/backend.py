"""Chooses, checks and gives back the Mitsuba variant; the only place that sets it.

A variant is a device and what a kernel carries along a path: linear RGB, or in spectral rendering radiance at sampled
wavelengths, or Mueller matrices of that. Everything runs in RGB but what stands in a `rendering` block.

The variant is a global of the process, shared by all threads (`mi.set_variant` exchanges the contents of the module
`mitsuba`), and belongs to the user: every public function works in a `session` and puts the user's variant back.
Mitsuba's objects stay usable while another variant is set, for each carries its own classes; only what is looked up in
the module (`mi.Float`, `mi.load_dict`) changes.

Mitsuba and Dr.Jit fall back silently (CUDA to LLVM to scalar) and, with a libLLVM older than 17, abort the process in
the middle of a render. Here neither happens: the backend is checked before the first kernel and a lack is an error that
says how to mend it.
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
from threading import Lock, get_ident
from typing import Any, Literal, ParamSpec, TypeVar, cast

import drjit as dr
import mitsuba as mi

from rsibr import clock
from rsibr.errors import InputError, MachineError

Device = Literal["cuda", "llvm"]

Rendering = Literal["rgb", "spectral", "spectral_polarized"]
"""What is carried along a path. Mitsuba has no polarised RGB: polarisation comes with spectra."""

MINIMUM_LLVM = 17
"""Dr.Jit 1.5 emits `llvm.maximum`, which LLVM 14, 15 and 16 cannot select on x86: the process aborts."""

VARIANT_OF: dict[Device, str] = {"cuda": "cuda_ad_rgb", "llvm": "llvm_ad_rgb"}
"""Mitsuba's RGB variant for each device. Both render scene-linear Rec.709 in float32."""

INSTALL_LLVM = (
    "install libLLVM 19: `apt install libllvm19` (Debian, Ubuntu), `dnf install llvm-libs` (Fedora), "
    "`brew install llvm` (macOS), `conda install -c conda-forge libllvm19` (any system), "
    "or point DRJIT_LIBLLVM_PATH at the library"
)

_rendering: ContextVar[Rendering] = ContextVar("rendering", default="rgb")

_choices: dict[tuple[Device | None, str, Rendering], str] = {}
"""Variant for a device, a value of `RSIBR_DEVICE` and a rendering: looking at the machine takes its microseconds."""

_registrations: list[Callable[[], None]] = []
_registered: dict[str, int] = {}
"""How many of `_registrations` have been called, for each variant."""


@dataclass
class _Occupancy:
    """Who is in a session: the variant of all threads is one.

    Attributes
    ----------
    depths : dict
        Nested sessions of each thread that is in one, by its identifier.
    users : str or None
        The variant that was set before the first of them.
    """

    depths: dict[int, int]
    users: str | None = None


_occupancy = _Occupancy({})
_lock = Lock()

_P = ParamSpec("_P")
_R = TypeVar("_R")


@dataclass(frozen=True)
class BackendReport:
    """What the machine offers to Dr.Jit, as `rsibr doctor` shows it.

    Attributes
    ----------
    cuda : bool
        Whether a CUDA device works.
    llvm_version : tuple of int or None
        Version of the libLLVM that Dr.Jit loads, or None where it finds none.
    llvm_path : str or None
        `DRJIT_LIBLLVM_PATH` where set; otherwise Dr.Jit chooses by its own search.
    """

    cuda: bool
    llvm_version: tuple[int, int, int] | None
    llvm_path: str | None

    @property
    def llvm_usable(self) -> bool:
        """Whether the libLLVM found is new enough to run a kernel without aborting the process."""
        return self.llvm_version is not None and self.llvm_version[0] >= MINIMUM_LLVM

    @property
    def device(self) -> Device | None:
        """The device that `use()` picks, or None where the machine has neither."""
        if self.cuda:
            return "cuda"
        return "llvm" if self.llvm_usable else None


def inspect() -> BackendReport:
    """Look at the machine without compiling a kernel and without setting a variant."""
    has_llvm = dr.has_backend(dr.JitBackend.LLVM)
    return BackendReport(
        cuda=bool(dr.has_backend(dr.JitBackend.CUDA)),
        llvm_version=tuple(dr.detail.llvm_version()) if has_llvm else None,
        llvm_path=os.environ.get("DRJIT_LIBLLVM_PATH"),
    )


def use(device: Device | None = None) -> str:
    """Set the Mitsuba variant for `device`, or for the best device that works.

    Inside a `rendering` block it is that rendering's, otherwise RGB's. The environment variable `RSIBR_DEVICE` (`cuda`
    or `llvm`) stands in for an absent argument.

    Parameters
    ----------
    device : {"cuda", "llvm"}, optional
        The device to insist on. By default CUDA where a device works, else LLVM.

    Returns
    -------
    str
        The variant that is now set, for example `"llvm_ad_rgb"`.

    Raises
    ------
    InputError
        If `RSIBR_DEVICE` names no known device.
    MachineError
        If the device does not work here, or libLLVM is missing or older than `MINIMUM_LLVM`. Never falls back.
    """
    variant = _chosen(device)
    if mi.variant() != variant:
        mi.set_variant(variant)
    if _registered.get(variant) != len(_registrations):
        _register_plugins(variant)
    clock.note_ready()
    return variant


class session:  # noqa: N801  # reads as the context managers of contextlib do, and is quicker
    """Work in rsibr's variant inside the block; afterwards, also after an exception, the user's is set again.

    Sessions nest, and take a few microseconds where the variant is the right one already; a change of variants takes
    0.05 s. A session inside another one, or inside a `rendering` block, keeps the device and the rendering in use.

    `with session() as variant` gives the name of the variant that is now set, for example `"llvm_ad_rgb"`.

    Raises
    ------
    InputError, MachineError
        As `use`. The variant is then as it was.

    Notes
    -----
    Mitsuba cannot go back to having no variant. Where none was set before, rsibr's RGB variant stays: it hides nothing,
    for without a variant nothing could have been made, and the user's own `mi.set_variant` works as before.

    The variant is shared by all threads. While several are in sessions, the user's is set again when the last one
    leaves. A thread that uses Mitsuba in another variant at the same time, or renders spectra beside one that renders
    RGB, needs a process of its own. Callbacks that a user hands in are called in rsibr's variant.

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
    """Decorate a function so that every call is a `session`; name, signature and docstring stay.

    Of a generator function each step is a session of its own: between the steps the user's variant is set.
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
    """Render otherwise inside the block: the variant of `kind` on the device in use, and that of before afterwards.

    Mitsuba's objects belong to the variant that they were made in: make scenes and BSDFs inside, and use them in a
    block of the same kind. Arrays and vectors are the same in all. What `session` says of threads, and of no variant
    before, holds here too.

    Yields
    ------
    str
        The variant that is now set, for example `"llvm_ad_spectral"`.

    Raises
    ------
    InputError, MachineError
        As `use`; also where Mitsuba was built without the variant.
    """
    outer = _rendering.set(kind)
    before, _ = _enter()
    try:
        yield use(_device_in_use())
    finally:
        _rendering.reset(outer)
        _leave(before)


def current_rendering() -> Rendering:
    """Return the rendering of the block at hand; RGB outside of any."""
    return _rendering.get()


def variant_name(device: Device, kind: Rendering) -> str:
    """Return Mitsuba's name of a variant; a MachineError where it was built without."""
    name = f"{device}_ad_{kind}"
    if name not in mi.variants():
        raise MachineError(f"this Mitsuba has no variant {name}", fix="install the mitsuba of requirements.lock")
    return name


def on_variant(register: Callable[[], None]) -> Callable[[], None]:
    """Have `register` called once for each variant that `use` sets: Mitsuba registers plugins per variant."""
    _registrations.append(register)
    return register


def synchronize() -> None:
    """Wait until the device has finished. Every timed region ends with this: Dr.Jit returns before the work is done."""
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
    """Note that this thread begins a session; the variant at its start, and whether it is nested in another."""
    thread = get_ident()
    with _lock:
        variant = mi.variant()
        if not _occupancy.depths:
            _occupancy.users = variant
        depth = _occupancy.depths.get(thread, 0)
        _occupancy.depths[thread] = depth + 1
    return variant, depth > 0


def _leave(before: str | None) -> None:
    """Note that a session ends, and set the variant of before it, unless another thread still needs this one."""
    thread = get_ident()
    with _lock:
        depth = _occupancy.depths.pop(thread) - 1
        if depth:
            _occupancy.depths[thread] = depth
            _set_back(before)
        elif not _occupancy.depths:
            _set_back(_occupancy.users)


def _set_back(variant: str | None) -> None:
    if variant is not None and mi.variant() != variant:
        mi.set_variant(variant)
    if variant is None and mi.variant() is not None:
        use(_device_in_use())  # no spectral variant stays behind


def _stepwise(function: Callable[..., Generator[Any, Any, Any]]) -> Callable[..., Generator[Any, Any, Any]]:
    """Wrap a generator function; its `rendering` blocks do not reach the code that its steps are handed to."""

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
                except Exception as error:  # thrown in by who iterates: the generator's to handle
                    step = partial(generator.throw, error)
        finally:
            context.run(_in_own_session, generator.close)

    return steps


def _in_own_session(step: Callable[[], _R]) -> _R:
    with session():
        return step()


def _device_in_use() -> Device | None:
    """The device of the variant that is set, so that a block does not leave it; None before the first."""
    device = (mi.variant() or "").partition("_ad_")[0]
    return device if device in VARIANT_OF else None


def _device_from_environment() -> Device | None:
    name = os.environ.get("RSIBR_DEVICE", "")
    if name not in ("", *VARIANT_OF):
        raise InputError(
            f"'{name}' is no device", where="RSIBR_DEVICE", fix=f"use one of: {', '.join(VARIANT_OF)}, or unset it"
        )
    return name or None  # type: ignore[return-value]  # checked just above


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
