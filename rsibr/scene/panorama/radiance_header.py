"""Header of a Radiance picture: format, factors on the values, primaries, and the order of its texels."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.panorama.picture import Chromaticities

_RGBE = "32-bit_rle_rgbe"
_XYZE = "32-bit_rle_xyze"

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_RESOLUTION = re.compile(rb"([+-])([XY])[ \t]+(\d{1,10})[ \t]+([+-])([XY])[ \t]+(\d{1,10})[ \t]*\r?")
_END = re.compile(rb"\n\r?\n")
_LONGEST_RESOLUTION = 200

_PROJECTIONS = {
    "v": "a perspective",
    "l": "a parallel projection",
    "c": "a cylindrical panorama",
    "h": "a hemispherical fisheye",
    "a": "an angular fisheye",
    "s": "a planisphere",
}

_SMALLEST, _LARGEST = 1e-30, 1e30


@dataclass(frozen=True)
class Resolution:
    """Order of the texels in a file.

    Attributes
    ----------
    scanlines, length : int
        Number of scan lines, and texels of each.
    upright : bool
        Whether scan lines are rows of the picture, not columns.
    downward, rightward : bool
        Whether the texels run from top to bottom, and from left to right.
    """

    scanlines: int
    length: int
    upright: bool
    downward: bool
    rightward: bool

    @property
    def texels(self) -> int:
        """Number of texels."""
        return self.scanlines * self.length

    def arranged(self, stored: NDArray[Any]) -> NDArray[Any]:
        """Arrange scan lines (scanlines, length, …) as rows from the top, columns from the left."""
        picture = stored if self.upright else np.swapaxes(stored, 0, 1)
        picture = picture if self.downward else picture[::-1]
        return picture if self.rightward else picture[:, ::-1]


@dataclass(frozen=True)
class RadianceHeader:
    """Header of a Radiance picture.

    Attributes
    ----------
    resolution : Resolution
        Order of the texels.
    factors : tuple of 3 floats
        Factors by which red, green and blue are to be multiplied for radiance: the inverse of all EXPOSURE and
        COLORCORR together.
    chromaticities : tuple of 8 floats, or None
        PRIMARIES; the last one, if there are several.
    size : int
        Bytes before the first scan line.
    notes : tuple of str
        What the user should know of the reading.
    """

    resolution: Resolution
    factors: tuple[float, float, float]
    chromaticities: Chromaticities | None
    size: int
    notes: tuple[str, ...]


def parse_header(data: bytes, where: str) -> RadianceHeader:
    """Parse the header of a Radiance picture.

    Parameters
    ----------
    data : bytes
        The file. Lines end with LF or CR LF; the header may have any length.
    where : str
        File that an error names.

    Raises
    ------
    InputError
        If the header is incomplete, its format is not RGBE, or a value is unreadable.

    Notes
    -----
    Radiance's reference manual, "File Formats"; src/common/header.c and color.h. A variable counts where its name
    stands at the beginning of a line: programs indent the header of a picture that theirs was made from.
    """
    end = _END.search(data)
    if end is None:
        raise InputError("its header has no end (an empty line)", where=where, fix="get it again")
    lines = [line.rstrip("\r") for line in data[: end.start()].decode("latin-1").split("\n")]
    _require_rgbe(_values(lines, "FORMAT"), where)
    _require_linear(_values(lines, "GAMMA"), where)
    primaries = [_numbers(value, 8, "PRIMARIES", where) for value in _values(lines, "PRIMARIES")]
    newline = data.find(b"\n", end.end(), end.end() + _LONGEST_RESOLUTION)
    line = data[end.end() : newline] if newline >= 0 else data[end.end() : end.end() + 40]
    return RadianceHeader(
        resolution=_resolution(line, where),
        factors=_factors(lines, where),
        chromaticities=tuple(primaries[-1]) if primaries else None,  # type: ignore[arg-type]  # 8 of them
        size=newline + 1,
        notes=tuple(_notes(_values(lines, "VIEW"))),
    )


def _values(lines: list[str], name: str) -> list[str]:
    return [line[len(name) + 1 :].strip() for line in lines if line.startswith(f"{name}=")]


def _require_rgbe(formats: list[str], where: str) -> None:
    if not formats:
        raise InputError("has no FORMAT line", where=where, fix=f"add FORMAT={_RGBE} to its header, if it is that")
    if len(set(formats)) > 1:
        raise InputError(
            f"has several FORMAT lines: {_shown(', '.join(formats))}", where=where, fix="keep the right one"
        )
    if formats[0] == _XYZE:
        raise InputError(
            "holds XYZ, not RGB: FORMAT=32-bit_rle_xyze does not say what is white, nor whether it is 179 times the "
            "radiance (luminance)",
            where=where,
            fix="convert it with Radiance's ra_xyze -r -o, or to OpenEXR",
        )
    if formats[0] != _RGBE:
        raise InputError(
            f"has FORMAT={_shown(formats[0])}, not {_RGBE}", where=where, fix="convert it to RGBE or OpenEXR"
        )


def _require_linear(gammas: list[str], where: str) -> None:
    for value in gammas:
        if _numbers(value, 1, "GAMMA", where) != [1.0]:
            raise InputError(f"has GAMMA={_shown(value)}: its values are not linear", where=where, fix="save it linear")


def _factors(lines: list[str], where: str) -> tuple[float, float, float]:
    """Inverse of the product of EXPOSURE and COLORCORR lines; each is positive and may stand several times."""
    product = np.ones(3)
    for name, count in (("EXPOSURE", 1), ("COLORCORR", 3)):
        for value in _values(lines, name):
            numbers = np.array(_numbers(value, count, name, where))
            if not (numbers > 0.0).all():
                raise InputError(f"has {name}={_shown(value)}, not positive", where=where, fix="correct its header")
            with np.errstate(over="ignore", under="ignore"):
                product = product * numbers
    if not ((product > _SMALLEST) & (product < _LARGEST)).all():
        raise InputError(
            f"its EXPOSURE and COLORCORR multiply to {', '.join(f'{value:.3g}' for value in product)}",
            where=where,
            fix="correct its header",
        )
    red, green, blue = (float(value) for value in 1.0 / product)
    return red, green, blue


def _numbers(value: str, count: int, name: str, where: str) -> list[float]:
    found = value.split()
    if len(found) != count or not all(re.fullmatch(_NUMBER, text) for text in found):
        what = "a number" if count == 1 else f"{count} numbers"
        raise InputError(f"has {name}={_shown(value)}, not {what}", where=where, fix="correct its header")
    return [float(text) for text in found]


def _resolution(line: bytes, where: str) -> Resolution:
    match = _RESOLUTION.fullmatch(line)
    shown = _shown(line.decode("latin-1").rstrip("\r"))
    if match is None or match[2] == match[5]:
        raise InputError(
            f"its resolution line is '{shown}', not like '-Y 512 +X 1024'", where=where, fix="get it again"
        )
    scanlines, length = int(match[3]), int(match[6])
    if not (scanlines and length):
        raise InputError(f"has no texel: its resolution line is '{shown}'", where=where, fix="get it again")
    upright = match[2] == b"Y"
    signs = {match[2]: match[1], match[5]: match[4]}
    return Resolution(scanlines, length, upright, downward=signs[b"Y"] == b"-", rightward=signs[b"X"] == b"+")


def _notes(views: list[str]) -> list[str]:
    projections = [_PROJECTIONS[kind] for view in views for kind in re.findall(r"(?:^|\s)-vt([vlchas])", view)]
    if not projections:
        return []
    return [f"its VIEW line says {projections[-1]}; read as latitude–longitude"]


def _shown(text: str) -> str:
    plain = "".join(character if character.isprintable() else "?" for character in text)
    return plain if len(plain) <= 60 else f"{plain[:57]}…"
