"""Headers of stored maps, read without pixels and held against the manifest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from rsibr.errors import BakeError
from rsibr.geometry.frame import view_frame
from rsibr.store.exr import open_exr
from rsibr.store.layers import layers_at
from rsibr.store.manifest import MAX_RESOLUTION, Manifest
from rsibr.store.map_file import COVERAGE, FRAME_KEY, VARIANCE, VIEW_KEY, WHOLE, MapFile

ANOTHER = "bake the view again with the same `rsibr bake` command, or bake anew with --fresh"

_TOLERANCE = 1e-6  # the header stores view and frame in float32
_COLOUR, _GREY = {"R", "G", "B"}, {"Y"}


class _OtherwiseStoredError(Exception):
    """A part is not stored as `rsibr.store.map_file` stores it."""


@dataclass(frozen=True, eq=False)
class MapHeader:
    """What the header of a map says about it.

    Attributes
    ----------
    view : ndarray of float64, shape (3,)
        Unit vector from the surface to the viewer, of float32 precision.
    frame : ndarray of float64, shape (3, 3)
        Columns x, y, z in world coordinates.
    resolution : int
        Texels along each side.
    parts : list of str
        Names of the parts, in the order of the file; without the sum of several layers, which repeats them.
    """

    view: NDArray[np.float64]
    frame: NDArray[np.float64]
    resolution: int
    parts: list[str]

    @classmethod
    def of(cls, map_file: MapFile) -> MapHeader:
        """Header of a decoded map."""
        parts = [name for name, _ in map_file.parts()]
        return cls(map_file.view, map_file.frame, map_file.resolution, parts)


def read_header(file: BinaryIO, where: str) -> MapHeader:
    """Read the headers of all parts of a map; no pixel is decoded, however large the file says to be.

    Parameters
    ----------
    file : binary file
        Open OpenEXR file, at its beginning.
    where : str
        Name of the file in an error.

    Raises
    ------
    BakeError
        If it is no OpenEXR map as `rsibr.store.map_file` writes it.
    """
    try:
        with open_exr(file, header_only=True) as exr:
            headers = [(part.name(), dict(part.header)) for part in exr.parts]
            sides = {_side(name, header) for name, header in headers}
            view, frame = (np.array(headers[0][1][key], np.float64) for key in (VIEW_KEY, FRAME_KEY))
        if len(sides) != 1:
            raise _OtherwiseStoredError("the parts differ in size")
    except _OtherwiseStoredError as error:
        raise BakeError(f"is not an OpenEXR map of rsibr: {error}", where=where) from error
    except (LookupError, RuntimeError, ValueError, TypeError, OSError, AttributeError, MemoryError) as error:
        raise BakeError("is not an OpenEXR map of rsibr, or is truncated or altered", where=where) from error
    return MapHeader(view, frame, sides.pop(), _without_sum([name for name, _ in headers]))


def check_header(header: MapHeader, manifest: Manifest, index: int, where: str) -> None:
    """Check that a map is that of the view `index` of a manifest: its view, frame, size and layers.

    Raises
    ------
    BakeError
        If it is another one; `where` names its file.
    """
    if header.resolution != manifest.resolution:
        _refuse(f"has {header.resolution}² texels, but {manifest.resolution}² in the manifest", where)
    view = np.array(manifest.directions[index])
    if not np.allclose(header.view, view, rtol=0.0, atol=_TOLERANCE):
        _refuse(f"shows the view {_shown(header.view)}, but view {index} of the manifest is {_shown(view)}", where)
    if not np.allclose(header.frame, view_frame(view), rtol=0.0, atol=_TOLERANCE):
        _refuse(f"has another frame than view {index}, whose x axis is horizontal", where)
    wanted = [*layers_at(manifest.lobes, index), VARIANCE, COVERAGE]
    if header.parts != wanted:
        _refuse(f"has the parts {', '.join(header.parts)}, not {', '.join(wanted)}", where)


def _without_sum(parts: list[str]) -> list[str]:
    """Leave out the sum of several layers, which bakes older than it lack."""
    is_sum = parts[:1] == [WHOLE] and len(set(parts) - {VARIANCE, COVERAGE}) > 1
    return parts[1:] if is_sum else parts


def _side(name: str, header: dict[str, Any]) -> int:
    """Texels a side of a part; raises if it is not stored as the format says."""
    if header["type"] != OpenEXR.scanlineimage or header["compression"] != OpenEXR.ZIP_COMPRESSION:
        raise _OtherwiseStoredError(f"part {name} has no scan lines in ZIP compression")
    channels = {channel.name for channel in header["channels"]}
    if channels != _GREY and (name == COVERAGE or channels != _COLOUR):
        raise _OtherwiseStoredError(f"part {name} has the channels {', '.join(sorted(channels))}")
    if any((channel.xSampling, channel.ySampling) != (1, 1) for channel in header["channels"]):
        raise _OtherwiseStoredError(f"part {name} is subsampled")
    windows = [np.array(header[key], np.int64) for key in ("dataWindow", "displayWindow")]
    side = int(windows[0].max()) + 1
    square = [[0, 0], [side - 1, side - 1]]
    if any(window.tolist() != square for window in windows) or not 1 <= side <= MAX_RESOLUTION:
        raise _OtherwiseStoredError(f"part {name} has the window {windows[0].tolist()}, not that of a square map")
    return side


def _refuse(what: str, where: str) -> None:
    raise BakeError(what, where=where, fix=ANOTHER)


def _shown(vector: NDArray[np.float64]) -> str:
    return f"({', '.join(f'{x:.4g}' for x in vector.ravel()[:3])})"
