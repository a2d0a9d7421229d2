"""Chooses and checks the Mitsuba variant; the only place that sets it.

A variant is a device and what a kernel carries along a path: linear RGB, or in spectral rendering radiance at sampled
wavelengths, or Mueller matrices of that. Everything runs in RGB but what stands in a `rendering` block.

Mitsuba and Dr.Jit fall back silently (CUDA to LLVM to scalar) and, with a libLLVM older than 17, abort the process in
the middle of a render. Here neither happens: the backend is checked before the first kernel and a lack is an error that
says how to mend it.
"""

from __future__ import annotations

import functools
import os
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import drjit as dr
import mitsuba as mi

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
_registrations: list[Callable[[], None]] = []
_registered_variants: set[str] = set()


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
    variant = variant_name(_working_device(device or _device_from_environment()), _rendering.get())
    if mi.variant() != variant:
        mi.set_variant(variant)
    _register_plugins(variant)
    return variant


@contextmanager
def rendering(kind: Rendering) -> Iterator[str]:
    """Render otherwise inside the block: the variant of `kind` on the device in use, and that of before afterwards.

    Mitsuba's objects belong to the variant that they were made in: make scenes and BSDFs inside, and use them in a
    block of the same kind. Arrays and vectors are the same in all.

    Yields
    ------
    str
        The variant that is now set, for example `"llvm_ad_spectral"`.

    Raises
    ------
    InputError, MachineError
        As `use`; also where Mitsuba was built without the variant.
    """
    before = _rendering.set(kind)
    try:
        yield use(_device_in_use())
    finally:
        _rendering.reset(before)
        use(_device_in_use())


@contextmanager
def session() -> Iterator[str]:
    """Run the block in rsibr's variant."""
    yield use(_device_in_use())


_F = TypeVar("_F", bound=Callable[..., Any])


def in_session(function: _F) -> _F:
    """Run a function in a `session`."""

    @functools.wraps(function)
    def run(*args: Any, **kwargs: Any) -> Any:
        with session():
            return function(*args, **kwargs)

    return run  # type: ignore[return-value]


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
    _registered_variants.clear()
    return register


def synchronize() -> None:
    """Wait until the device has finished. Every timed region ends with this: Dr.Jit returns before the work is done."""
    dr.sync_thread()


def _register_plugins(variant: str) -> None:
    if variant in _registered_variants:
        return
    for register in _registrations:
        register()
    _registered_variants.add(variant)


def _device_in_use() -> Device | None:
    """The device of the variant that is set, so that a block does not leave it; None before the first."""
    variant = mi.variant() or ""
    return next((device for device in VARIANT_OF if variant.startswith(f"{device}_ad_")), None)


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
