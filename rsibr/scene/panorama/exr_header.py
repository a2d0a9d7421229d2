"""What the header of an OpenEXR part says about its picture, obeyed or refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import OpenEXR

from rsibr.errors import InputError
from rsibr.scene.panorama.exr_channels import Candidate, Header

_ACES = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
"""Primaries and white of ACES 2065-1, which an ACES container holds: SMPTE ST 2065-1:2021, table 1."""

_UNSTATED = ("", "unknown")
_CIE_XYZ = "lin_ciexyzd65_scene"
_XYZ_PRIMARIES = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0)

_LINEAR = ("lin", "scene_linear", "raw", "acescg", "aces2065", "ocio:lin")
"""What a name in `oiio:ColorSpace` begins with if it is scene-linear."""

_LARGEST_COORDINATE = 2**30


@dataclass(frozen=True)
class Window:
    """Part of the stored picture that is the panorama.

    Attributes
    ----------
    stored : tuple of int
        Height and width as stored.
    rows, columns : tuple of int
        First, and one after the last.
    """

    stored: tuple[int, int]
    rows: tuple[int, int]
    columns: tuple[int, int]

    @property
    def texels(self) -> int:
        """Number of stored texels."""
        return self.stored[0] * self.stored[1]


def window_of(header: Header, chosen: Candidate) -> tuple[Window, tuple[str, ...]]:
    """Find the panorama in the data window, wherever its origin is.

    Parameters
    ----------
    header : mapping
        Header of the part.
    chosen : Candidate
        Channels that will be read.

    Returns
    -------
    window : Window
        The display window. Texels around it (overscan) are cut off.
    notes : tuple of str

    Raises
    ------
    InputError
        If the part is no flat picture with a value in each texel, or the data window does not cover the display window;
        `where` is left to the caller.
    """
    if header["type"] not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
        raise InputError("holds deep data, several samples a texel", fix="flatten it")
    sampled = {channel.name: (channel.xSampling, channel.ySampling) for channel in header["channels"]}
    coarse = [name for name in chosen.channels if sampled[name] != (1, 1)]
    if coarse:
        raise InputError(f"its channel {coarse[0]} has no value at each texel (subsampled)", fix="save it as RGB")
    left, top, right, bottom = _box(header["dataWindow"])
    data, display = (left, top, right, bottom), _box(header["displayWindow"])
    stored = (bottom - top + 1, right - left + 1)
    if data == display:
        return Window(stored, (0, stored[0]), (0, stored[1])), ()
    covers = data[0] <= display[0] and data[1] <= display[1] and data[2] >= display[2] and data[3] >= display[3]
    if not covers:
        raise InputError(
            f"shows only a part of its panorama: its data window {_told(data)} does not cover its display window "
            f"{_told(display)}",
            fix="save it with one window",
        )
    if "envmap" in header:  # whose formulas take the data window for the whole sphere
        raise InputError(
            f"its envmap attribute refers to its data window {_told(data)}, which is not its display window",
            fix="save it with one window",
        )
    rows = (display[1] - top, display[3] - top + 1)
    columns = (display[0] - left, display[2] - left + 1)
    return Window(stored, rows, columns), ("the texels outside its display window (overscan) were cut off",)


def layout_of(header: Header) -> str:
    """Layout of the picture, see `Picture.layout`; InputError if `envmap` is none that OpenEXR defines."""
    stated = header.get("envmap")
    if stated is None:
        return "plain"
    known = {OpenEXR.ENVMAP_LATLONG: "latlong", OpenEXR.ENVMAP_CUBE: "cube"}
    if not isinstance(stated, OpenEXR.Envmap) or stated not in known:
        raise InputError(f"its attribute envmap is {_value(stated)}, no layout that OpenEXR defines", fix="correct it")
    return known[stated]


def colours_of(header: Header) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Colours that a header states.

    Parameters
    ----------
    header : mapping
        Header of the part.

    Returns
    -------
    colours : dict
        Values of `Picture.chromaticities` and `Picture.neutral`, JSON-compatible.
    notes : tuple of str

    Raises
    ------
    InputError
        If an attribute has another type than OpenEXR's standard, or says that the values are not scene-linear; `where`
        is left to the caller.
    """
    chromaticities = _numbers(header, "chromaticities", 8)
    identified = _identified(header)
    if chromaticities is None:
        chromaticities = identified
    elif identified is not None and not np.allclose(chromaticities, identified, rtol=0.0, atol=2e-3):
        raise InputError(
            f"states two colour spaces: chromaticities, and colorInteropID {_value(header['colorInteropID'])}",
            fix="remove the wrong one",
        )
    if chromaticities is None and header.get("acesImageContainerFlag") == 1:
        chromaticities = list(_ACES)
    neutral = _numbers(header, "adoptedNeutral", 2)
    return {"chromaticities": chromaticities, "neutral": neutral}, tuple(_colour_notes(header))


def _colour_notes(header: Header) -> Sequence[str]:
    notes = []
    luminance = _numbers(header, "whiteLuminance", 1)
    if luminance is not None:
        notes.append(
            f"its whiteLuminance ({luminance[0]:g} cd/m² for RGB (1, 1, 1)) is not applied; environment.scale can do it"
        )
    named = header.get("oiio:ColorSpace")
    if isinstance(named, str) and named and not named.lower().startswith(_LINEAR):
        notes.append(f"its oiio:ColorSpace is {_value(named)}; the values are read as scene-linear")
    return notes


def _identified(header: Header) -> list[float] | None:
    """Chromaticities of `colorInteropID`; None if it names no colour space."""
    name = header.get("colorInteropID", "")
    if name in _UNSTATED:
        return None
    if name == _CIE_XYZ:
        return list(_XYZ_PRIMARIES)
    found = OpenEXR.colorInteropIDToChromaticities(name) if isinstance(name, str) else None
    if found is None:
        raise InputError(
            f"its colorInteropID is {_value(name)}, no scene-linear colour space that OpenEXR defines",
            fix="convert it to lin_rec709_scene",
        )
    return [float(value) for value in found]


def _numbers(header: Header, name: str, count: int) -> list[float] | None:
    """Value of an attribute as numbers; None if it is absent."""
    if name not in header:
        return None
    try:
        values = np.atleast_1d(np.array(header[name], dtype=np.float64))
    except (TypeError, ValueError):
        values = np.empty(0)
    if isinstance(header[name], str) or values.shape != (count,):
        raise InputError(f"its attribute {name} is {_value(header[name])}, not {count} numbers", fix="correct it")
    return [float(value) for value in values]


def _box(corners: Any) -> tuple[int, int, int, int]:
    left, top, right, bottom = (int(value) for value in np.ravel(corners))
    if right < left or bottom < top or max(map(abs, (left, top, right, bottom))) > _LARGEST_COORDINATE:
        raise InputError(f"has the window {_told((left, top, right, bottom))}, which is none", fix="save it again")
    return left, top, right, bottom


def _told(box: tuple[int, int, int, int]) -> str:
    return f"({box[0]}, {box[1]})–({box[2]}, {box[3]})"


def _value(value: Any) -> str:
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
