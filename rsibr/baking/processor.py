"""Processor that kernels are compiled for; code for another one rounds differently, so that maps get other bits."""

from __future__ import annotations

import ctypes
from pathlib import Path

import drjit as dr

from rsibr.store.atomic import checksum

_CPU, _FEATURES, _WIDTH = "_Z19jit_llvm_target_cpuv", "_Z24jit_llvm_target_featuresv", "_Z21jit_llvm_vector_widthv"
"""Functions of Dr.Jit's core, as C++ names them; its Python package tells none of this."""

_LIBRARIES = ("libdrjit-core.so", "libdrjit-core.dylib")


def processor(variant: str) -> dict[str, str | int]:
    """Target of the kernels of a variant.

    Parameters
    ----------
    variant : str
        Mitsuba variant.

    Returns
    -------
    dict
        For LLVM its version, the name of the processor, digest of its features, and lanes of its vectors; bakes are
        bit-identical where all of these are. Only the device for CUDA.

    Examples
    --------
    >>> sorted(processor("llvm_ad_rgb"))
    ['device', 'features', 'lanes', 'llvm', 'target']
    """
    device = variant.partition("_")[0]
    if device != "llvm":
        return {"device": device}
    dr.eval(dr.llvm.Float(1) + dr.opaque(dr.llvm.Float, 1))  # the backend is set up at its first use
    library = core_library()
    features = sorted((_text(library, _FEATURES) or "").split(","))
    return {
        "device": device,
        "llvm": ".".join(map(str, dr.detail.llvm_version())),
        "target": _text(library, _CPU) or "",
        "features": checksum(",".join(features).encode()),
        "lanes": int(getattr(library, _WIDTH)()),
    }


def core_library() -> ctypes.CDLL:
    """Dr.Jit's core, which is loaded already."""
    folder = Path(dr.__file__).parent
    return ctypes.CDLL(str(next(folder / name for name in _LIBRARIES if (folder / name).exists())))


def _text(library: ctypes.CDLL, name: str) -> str | None:
    function = getattr(library, name)
    function.restype = ctypes.c_char_p
    found: bytes | None = function()
    return None if found is None else found.decode()
