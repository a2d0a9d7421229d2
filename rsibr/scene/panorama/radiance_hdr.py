"""Reading of Radiance pictures (.hdr, .pic): flat texels and both kinds of run lengths, in any order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.panorama.picture import Picture
from rsibr.scene.panorama.radiance_header import RadianceHeader, parse_header
from rsibr.scene.panorama.source import opened

_LONGEST = 0x7FFF
"""Texels at most in a scan line of which each component has its own run lengths."""

Texels = NDArray[np.uint8]


def read_radiance(path: Path, most_texels: int) -> Picture:
    """Read a Radiance picture.

    Parameters
    ----------
    path : Path
        The file, RGBE.
    most_texels : int
        Texels at most.

    Returns
    -------
    Picture
        Radiance: the values divided by all EXPOSURE and COLORCORR lines.

    Raises
    ------
    InputError
        If the file is truncated, damaged or not RGBE, or its header is not readable.
    """
    where = str(path)
    with opened(path) as stream:
        try:
            data = stream.read()
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", where=where) from None
    header = parse_header(data, where)
    resolution = header.resolution
    if resolution.texels > most_texels:
        shape = (resolution.length, resolution.scanlines)
        width, height = shape if resolution.upright else shape[::-1]
        raise InputError(
            f"{width} × {height} texels are more than {most_texels}", where=where, fix="scale the map down"
        )
    stored, end = _scanlines(data, header, where)
    left = len(data) - end
    notes = (f"{left} bytes after its last scan line were not read",) if left > 1 else ()
    image = _radiance(resolution.arranged(stored), header, where)
    return Picture(image, chromaticities=header.chromaticities, notes=(*header.notes, *notes))


def _radiance(texels: Texels, header: RadianceHeader, where: str) -> NDArray[np.float32]:
    """Radiance (H, W, 3) of texels (H, W, 4): mantissa · 2^(exponent − 136), as Mitsuba reads it.

    Radiance itself adds ½ to each mantissa, half a step of the eight bits; then black would not be black.
    """
    exponent = texels[..., 3].astype(np.int32)
    scale = np.where(exponent > 0, np.ldexp(np.float32(1.0), exponent - 136), np.float32(0.0))
    image = texels[..., :3].astype(np.float32) * scale[..., None]
    if header.factors != (1.0, 1.0, 1.0):
        with np.errstate(over="ignore"):
            image = image * np.array(header.factors, dtype=np.float32)
        if not np.isfinite(image).all():
            raise InputError(
                f"its EXPOSURE and COLORCORR give radiance beyond {np.finfo(np.float32).max:.2g}",
                where=where,
                fix="correct its header",
            )
    return np.ascontiguousarray(image, dtype=np.float32)


def _scanlines(data: bytes, header: RadianceHeader, where: str) -> tuple[Texels, int]:
    """Decode all scan lines, and say where the last one ends: src/common/color.c, `freadcolrs`."""
    count, length = header.resolution.scanlines, header.resolution.length
    least = 1 if length <= _LONGEST else 4  # bytes of a scan line, with room to spare
    if (len(data) - header.size) // least < count:
        raise _truncated(0, count, where, f"{len(data) - header.size} bytes cannot hold them")
    try:
        texels = np.empty((count, length, 4), np.uint8)
    except MemoryError:
        raise InputError("does not fit into the memory", where=where, fix="scale the map down") from None
    at = header.size
    for row in range(count):
        start = data[at : at + 4]
        if len(start) < 4:
            raise _truncated(row, count, where)
        by_component = start[0] == start[1] == 2 and start[2] < 128
        try:
            at = (_components if by_component else _old_runs)(data, at, texels[row])
        except EOFError:
            raise _truncated(row, count, where) from None
        except ValueError as error:
            raise InputError(f"is damaged in scan line {row}: {error}", where=where, fix="get it again") from None
    return texels, at


def _components(data: bytes, at: int, line: Texels) -> int:
    """Decode run lengths of each component; return where the scan line ends."""
    length = len(line)
    told = data[at + 2] << 8 | data[at + 3]
    if told != length:
        raise ValueError(f"it has {told} texels, not {length}")
    at += 4
    decoded = bytearray()
    for component in range(1, 5):
        end = component * length
        while len(decoded) < end:
            code = data[at : at + 2]
            if len(code) < 2:
                raise EOFError
            if code[0] > 128:
                decoded += code[1:] * (code[0] - 128)
                at += 2
            else:
                literal = data[at + 1 : at + 1 + code[0]]
                if len(literal) < code[0]:
                    raise EOFError
                decoded += literal
                at += 1 + code[0]
        if len(decoded) > end:
            raise ValueError("a run goes beyond its end")
    line[:] = np.frombuffer(decoded, np.uint8).reshape(4, length).T
    return at


def _old_runs(data: bytes, at: int, line: Texels) -> int:
    """Decode flat texels with runs (1, 1, 1, n), n copies of the texel before; return where the scan line ends.

    Runs that follow each other are the digits of one number, the lowest first. The first texel is never a run.
    """
    length, span = len(line), len(line)
    while True:
        quads = np.frombuffer(data[at : at + 4 * span], np.uint8)
        quads = quads[: len(quads) // 4 * 4].reshape(-1, 4)
        run = (quads[:, :3] == 1).all(axis=1)
        run[0] = False
        copies = _copies(quads, run)
        filled = np.minimum.accumulate(length - np.cumsum(copies)) <= 0
        if filled.any():
            break
        if len(quads) < span:
            raise EOFError
        span *= 2  # runs of no copies
    used = int(np.argmax(filled)) + 1
    source = np.maximum.accumulate(np.where(run, 0, np.arange(len(run))))[:used]
    line[:] = np.repeat(quads[source], copies[:used], axis=0)[:length]
    return at + 4 * used


def _copies(quads: Texels, run: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Texels that each group of four bytes stands for."""
    index = np.arange(len(run))
    before = np.maximum.accumulate(np.where(run, -1, index))  # last texel that is no run
    digit = np.minimum(index - before - 1, 4)  # more digits than any scan line is long
    counts = np.minimum(quads[:, 3].astype(np.int64) << (8 * np.maximum(digit, 0)), 1 << 31)
    return np.where(run, counts, 1)


def _truncated(row: int, count: int, where: str, why: str = "") -> InputError:
    return InputError(
        f"is truncated: it ends in scan line {row} of {count}{f' ({why})' if why else ''}",
        where=where,
        fix="get it again",
    )
