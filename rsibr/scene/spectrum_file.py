"""Spectrum files: text, a wavelength [nm] and a value in each line."""

from __future__ import annotations

import math
from pathlib import Path

from rsibr.errors import InputError
from rsibr.regular_file import is_file

_LARGEST = 2**24
"""Bytes of the largest spectrum file that is read: a million lines."""


def read_spectrum(file: Path, where: str) -> list[tuple[float, float]]:
    """Read a spectrum file, as Mitsuba does; `#` starts a comment.

    Parameters
    ----------
    file : Path
        The file, usually `*.spd`.
    where : str
        File or config key that an error names.

    Returns
    -------
    list of (float, float)
        Wavelengths [nm] and values, ascending.

    Raises
    ------
    InputError
        If it is unreadable, or a line is not two finite numbers. The line is named by its number and not quoted: the
        name may be that of any file of the machine.
    """
    samples: list[tuple[float, float]] = []
    fix = "write a wavelength in nanometres and a value in each line, in ascending order"
    for number, line in enumerate(_lines(file, where), start=1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            wavelength, value = (float(word) for word in words)
        except ValueError:
            raise InputError(f"{file}, line {number}, is not a wavelength and a number", where=where, fix=fix) from None
        if not (math.isfinite(wavelength) and math.isfinite(value)):
            raise InputError(f"{file}, line {number}, holds a number that is not finite", where=where, fix=fix)
        if samples and wavelength <= samples[-1][0]:
            raise InputError(f"{file}, line {number}: the wavelengths do not ascend", where=where, fix=fix)
        samples.append((wavelength, value))
    if len(samples) < 2:
        raise InputError(f"{file} holds fewer than two wavelengths, no spectrum", where=where, fix=fix)
    return samples


def _lines(file: Path, where: str) -> list[str]:
    if not is_file(file):
        raise InputError(f"there is no file {file}", where=where, fix="check the path under filename")
    try:
        if file.stat().st_size > _LARGEST:
            raise InputError(f"{file} is too large for a spectrum", where=where, fix="is it a text file?")
        return file.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{file} is no text, and no spectrum", where=where, fix="name a text file") from None
    except OSError as error:
        raise InputError(f"{file} is not readable: {error.strerror}", where=where) from None
