"""Child process of `rsibr.scene.panorama.exr`: decodes OpenEXR files, which may crash it.

`python -m rsibr.scene.panorama.exr_server` reads requests from stdin, one JSON object a line, and answers each with a
line of JSON, which the pixels follow (float32). It ends when stdin is closed, or when it was not asked for `IDLE`
seconds. Mitsuba is not imported: the process starts in 0.2 s.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import resource
import select
import sys
import tempfile
from collections.abc import Iterator
from typing import IO, Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.panorama.exr_channels import Candidate, choose
from rsibr.scene.panorama.exr_header import colours_of, layout_of, window_of

BEGUN = "rsibr reads OpenEXR"
"""First line that the process writes; without it the interpreter could not run it."""

IDLE = 20.0
"""Seconds without a request after which the process ends."""

_UNOPENED = re.compile(r".*\b[Uu]nable to open .* for read.*|.* when attempting to open .*", re.DOTALL)
_BAD_HEADER = "OpenEXR finds its header invalid"
_DAMAGED = "get it again, or save it again as OpenEXR"


def decode(
    path: str, layer: str | None, most_texels: int, log: IO[bytes]
) -> tuple[dict[str, Any], NDArray[np.float32]]:
    """Decode the environment in a file.

    Parameters
    ----------
    path : str
        The file.
    layer : str or None
        See `rsibr.scene.panorama.exr_channels.choose`.
    most_texels : int
        Texels at most.
    log : file
        Where OpenEXR writes what it finds wrong.

    Returns
    -------
    stated : dict
        What the header says: `xyz`, `chromaticities`, `neutral`, `layout`, `notes`, as in `Picture`.
    image : ndarray (H, W, C), float32
        Three channels, or one that is grey.

    Raises
    ------
    InputError
        If the file cannot be used; without `where`.
    """
    with _reasons(log):
        return _decoded(path, layer, most_texels)


def _decoded(path: str, layer: str | None, most_texels: int) -> tuple[dict[str, Any], NDArray[np.float32]]:
    with OpenEXR.File(path, header_only=True) as file:
        headers = [dict(part.header) for part in file.parts]
    if not headers:
        raise InputError("has no part", fix=_DAMAGED)
    chosen, notes = choose(headers, layer)
    header = headers[chosen.part]
    window, cut = window_of(header, chosen)
    if window.texels > most_texels:
        height, width = window.stored
        raise InputError(f"{width} × {height} texels are more than {most_texels}", fix="scale the map down")
    colours, noted = colours_of(header)
    layout = layout_of(header)
    stored = _pixels(path, chosen, len(headers))
    if stored.shape[:2] != window.stored:
        raise InputError("is truncated or damaged: its pixels are not as many as its header says", fix=_DAMAGED)
    image = stored[slice(*window.rows), slice(*window.columns)]
    stated = {"xyz": chosen.xyz, "layout": layout, "notes": [*notes, *cut, *noted], **colours}
    return stated, np.ascontiguousarray(image)


def _pixels(path: str, chosen: Candidate, parts: int) -> NDArray[np.float32]:
    """Pixels (H, W, C) of the chosen channels. OpenEXR leaves out the parts that it cannot decode, without raising."""
    with OpenEXR.File(path, separate_channels=True) as file:
        if len(file.parts) != parts:
            raise RuntimeError("its pixels cannot be decoded")
        channels = file.parts[chosen.part].channels
        pixels = [channels[name].pixels for name in chosen.channels]
    kinds = sorted({str(values.dtype) for values in pixels if not np.issubdtype(values.dtype, np.floating)})
    if kinds:
        raise InputError(f"holds {', '.join(kinds)}, not radiance", fix="save it as half or float")
    return np.stack([values.astype(np.float32, copy=False) for values in pixels], axis=-1)


@contextlib.contextmanager
def _reasons(log: IO[bytes]) -> Iterator[None]:
    """Turn what OpenEXR raises into an `InputError` with the cause that it has written to `log`."""
    log.seek(0)
    log.truncate()
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # where OpenEXR's package prints warnings
            yield
    except InputError:
        raise
    except MemoryError:
        raise InputError("does not fit into the memory", fix="scale the map down") from None
    except UnicodeDecodeError:
        raise InputError(
            "holds a text that is not UTF-8, which OpenEXR's Python package does not read",
            fix="remove the attribute, or save it again as OpenEXR",
        ) from None
    except Exception as error:  # of many types, for what is damaged
        log.seek(0)
        reason = _cause(log.read().decode(errors="replace")) or _UNOPENED.sub(_BAD_HEADER, str(error))
        raise InputError(f"is truncated or damaged: {reason}", fix=_DAMAGED) from None


def _cause(log: str) -> str:
    """First line of OpenEXR's log, without the name of the file and the error's code."""
    lines = [line for line in log.splitlines() if "(EXR_ERR_" in line]
    return re.sub(r"^.*?\(EXR_ERR_\w+\)\s*", "", lines[0]).rstrip(" .") if lines else ""


def _answer(request: dict[str, Any], log: IO[bytes]) -> tuple[dict[str, Any], bytes | memoryview]:
    try:
        stated, image = decode(request["path"], request["layer"], request["most_texels"], log)
    except InputError as error:
        return {"error": [error.what, error.fix]}, b""
    except MemoryError:
        return {"error": ["does not fit into the memory", "scale the map down"]}, b""
    return {**stated, "shape": image.shape}, image.data.cast("B")


def main() -> int:
    """Serve requests until stdin ends or nothing was asked for a while."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    _limit_memory()
    channel = os.fdopen(os.dup(1), "wb")
    requests = os.fdopen(os.dup(0), "rb", buffering=0)
    with tempfile.TemporaryFile() as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        channel.write(f"{BEGUN}\n".encode())
        channel.flush()
        while select.select([requests], [], [], IDLE)[0]:
            line = requests.readline()
            if not line:
                break
            told, pixels = _answer(json.loads(line), log)
            channel.write(json.dumps(told).encode() + b"\n")
            channel.write(pixels)
            channel.flush()
    return 0


def _limit_memory() -> None:
    """Let an allocation beyond the memory of the machine fail, which Linux would grant and then kill a process for."""
    whole = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (whole if hard == resource.RLIM_INFINITY else min(whole, hard), hard))


if __name__ == "__main__":
    sys.exit(main())
