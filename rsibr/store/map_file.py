"""Radiance sphere map as a self-describing multi-part OpenEXR file.

The first part is `radiance`, the whole map (R, G, B), which is what a program that knows nothing of rsibr shows. Of
several lobes it is the sum, and one part a lobe follows. Then `variance` (R, G, B), then `coverage` (Y); float32, ZIP;
a grey map has Y in place of R, G, B. Every part's header holds the view vector (`rsibr:view`, v3f), the frame
(`rsibr:frame`, m33f, columns x, y, z in world coordinates) and a digest of the pixels (`rsibr:digest`), because OpenEXR
does not raise on a truncated file. The sum is not in the digest: it must equal the sum of the lobes to the bit.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import BakeError
from rsibr.store.atomic import checksum, read_bytes, write_atomic
from rsibr.store.exr import encode_parts, open_exr

Image = NDArray[np.float32]

WHOLE = "radiance"
"""Name of the first part: the only layer of a map, or the sum of several."""

VARIANCE = "variance"
COVERAGE = "coverage"
VIEW_KEY = "rsibr:view"
FRAME_KEY = "rsibr:frame"
DIGEST_KEY = "rsibr:digest"

_FRAME_TOLERANCE = 1e-5  # the headers are float32


@dataclass(frozen=True, eq=False, repr=False)
class MapFile:
    """Sphere map of one view, as stored in a file.

    Attributes
    ----------
    view : ndarray of float64, shape (3,)
        Unit vector from the surface to the viewer, in world coordinates; of float32 precision if read from a file.
    frame : ndarray of float64, shape (3, 3)
        Rotation whose columns are x (right), y (up) and z = `view` in world coordinates.
    layers : dict of str to ndarray of float32, shape (N, N, 3)
        Radiance [W sr⁻¹ m⁻²] of each lobe, or of the sum of several (see `rsibr.store.layers`), row 0 at the top, in
        the order of the file's parts. Their sum is the map. `WHOLE` names a layer that is the only one.
    variance : ndarray of float32, shape (N, N, 3), or None
        Variance of the mean of the summed lobes; None if unknown, as for a reconstructed map.
    coverage : ndarray of float32, shape (N, N)
        Share of each texel that lies inside the unit disk.
    grey : bool
        Whether a part with three equal channels is written as one, Y, which a reader expands to three.

    Raises
    ------
    ValueError
        If a shape, a type or the frame differs from the above.
    """

    view: NDArray[np.float64]
    frame: NDArray[np.float64]
    layers: dict[str, Image]
    variance: Image | None
    coverage: Image
    grey: bool = False

    def __repr__(self) -> str:
        x, y, z = self.view
        return f"MapFile(view ({x:.3g}, {y:.3g}, {z:.3g}), {len(self.coverage)}²: {', '.join(self.layers)})"

    def __post_init__(self) -> None:
        """Reject what the file format cannot represent."""
        if not self.layers or not all(self.layers) or {VARIANCE, COVERAGE} & set(self.layers):
            raise ValueError(f"layers need names, other than '{VARIANCE}' and '{COVERAGE}': {list(self.layers)}")
        if self.is_split and WHOLE in self.layers:
            raise ValueError(f"'{WHOLE}' is the sum of the layers, not one of them: {list(self.layers)}")
        if self.resolution < 1:
            raise ValueError("a map needs at least one texel")
        for name, image in self.parts():
            expected = (self.resolution, self.resolution) + (() if name == COVERAGE else (3,))
            if image.shape != expected or image.dtype != np.float32:
                raise ValueError(f"{name} is {image.dtype} {image.shape}, not float32 {expected}")
        _check_frame(self.view, self.frame)

    @property
    def resolution(self) -> int:
        """Texels along each side, N."""
        return len(self.coverage)

    @property
    def is_split(self) -> bool:
        """Whether there are several layers, so that a file holds their sum too."""
        return len(self.layers) > 1

    @property
    def radiance(self) -> Image:
        """Radiance of the whole material [W sr⁻¹ m⁻²], shape (N, N, 3): the sum of the layers."""
        return np.asarray(np.sum(list(self.layers.values()), axis=0, dtype=np.float32))

    def parts(self) -> Iterator[tuple[str, Image]]:
        """Name and pixels of each layer, of variance and coverage, in the order of the file."""
        yield from self.layers.items()
        if self.variance is not None:
            yield VARIANCE, self.variance
        yield COVERAGE, self.coverage


def write_map(path: Path, map_file: MapFile) -> str:
    """Write a map to `path`, atomically; equal maps give equal bytes.

    Parameters
    ----------
    path : Path
        File to write or to replace; its folder must exist.
    map_file : MapFile
        The map.

    Returns
    -------
    str
        SHA-256 of the file's bytes, in hexadecimal.

    Raises
    ------
    MachineError
        If the disk is full or fails.
    BakeError
        If the folder is missing or not writable.
    """
    data = encode_map(map_file)
    write_atomic(Path(path), data)
    return checksum(data)


def read_map(path: Path) -> MapFile:
    """Read a map written by `write_map`.

    Non-finite texels are accepted; whether they matter depends on the coverage and on the use.

    Raises
    ------
    BakeError
        If the file cannot be read, is truncated or altered, or is not a map of rsibr.
    """
    return decode_map(read_bytes(Path(path)), where=str(path))


def encode_map(map_file: MapFile) -> bytes:
    """Bytes of the OpenEXR file, without times or paths, so that equal maps give equal bytes."""
    header = {
        VIEW_KEY: np.asarray(map_file.view, np.float32),
        FRAME_KEY: np.ascontiguousarray(map_file.frame, np.float32),
        DIGEST_KEY: map_digest(map_file),
    }
    images = {WHOLE: map_file.radiance} if map_file.is_split else {}
    images |= dict(map_file.parts())
    return encode_parts((name, _channels(name, image, map_file.grey), header) for name, image in images.items())


def decode_map(data: bytes, where: str) -> MapFile:
    """Decode a file of `encode_map`; `where` names the file in an error.

    Raises
    ------
    BakeError
        If the bytes are truncated or altered, or are not a map of rsibr.
    """
    try:
        with open_exr(io.BytesIO(data)) as file:
            headers = [dict(part.header) for part in file.parts]
            images = {part.name(): _pixels(part) for part in file.parts}
            grey = all("Y" in part.channels for part in file.parts)
        stored_sum = images.pop(WHOLE) if len(images.keys() - {VARIANCE, COVERAGE}) > 1 and WHOLE in images else None
        map_file = _assemble(headers, images, stored_sum, grey)
        whole = _agree(headers) and headers[0][DIGEST_KEY] == map_digest(map_file)
    except KeyError as error:
        raise BakeError(f"is not a whole map of rsibr: {error.args[0]} is missing", where=where) from error
    except (RuntimeError, ValueError, TypeError, OSError, MemoryError) as error:
        raise BakeError("is not an OpenEXR map of rsibr, or is truncated or altered", where=where) from error
    if not whole:
        raise BakeError("is truncated or altered: its pixels do not match its headers", where=where)
    if stored_sum is not None and not np.array_equal(stored_sum, map_file.radiance, equal_nan=True):
        raise BakeError(f"is altered: its part {WHOLE} is not the sum of its lobes", where=where)
    return map_file


def _assemble(headers: list[dict[str, Any]], images: dict[str, Image], stored_sum: Image | None, grey: bool) -> MapFile:
    if len(images) + (stored_sum is not None) != len(headers) or not headers:
        raise ValueError("parts are missing or share a name")
    coverage, variance = images.pop(COVERAGE), images.pop(VARIANCE, None)
    view, frame = (np.array(headers[0][key], np.float64) for key in (VIEW_KEY, FRAME_KEY))
    return MapFile(view=view, frame=frame, layers=images, variance=variance, coverage=coverage, grey=grey)


def _is_grey(image: Image) -> bool:
    return all(np.array_equal(image[..., 0], image[..., c], equal_nan=True) for c in (1, 2))


def _agree(headers: list[dict[str, Any]]) -> bool:
    """Whether all parts have the same view, frame and digest."""
    return all(
        np.array_equal(header[key], headers[0][key]) for header in headers for key in (VIEW_KEY, FRAME_KEY, DIGEST_KEY)
    )


def _channels(part: str, image: Image, grey: bool) -> dict[str, Image]:
    """Channels of a part: OpenEXR's Python package names the channels R, G, B together "RGB"."""
    # Check the pixels besides the flag, so that no colour is lost
    stored = image[..., 0] if grey and part != COVERAGE and _is_grey(image) else image
    return {"RGB" if stored.ndim == 3 else "Y": stored}


def _pixels(part: Any) -> Image:
    channels = part.channels
    name = "RGB" if "RGB" in channels and part.name() != COVERAGE else "Y"
    if set(channels) != {name} or channels[name].pixels is None:
        raise KeyError(f"channel {name} of part {part.name()}")
    pixels: Image = channels[name].pixels
    is_colour = name == "Y" and part.name() != COVERAGE
    return np.repeat(pixels[..., None], 3, axis=-1) if is_colour else pixels


def map_channels(layers: int) -> int:
    """Channels of a map file of so many layers: the layers, their sum if there are several, variance and coverage.

    Examples
    --------
    >>> map_channels(1), map_channels(2)
    (7, 13)
    """
    return 3 * (layers + (layers > 1)) + 3 + 1


def map_digest(map_file: MapFile) -> str:
    """SHA-256 of view, frame and the pixels of layers, variance and coverage, as stored."""
    digest = hashlib.sha256()
    for values in (map_file.view, map_file.frame):
        digest.update(np.asarray(values, "<f4").tobytes())
    for name, image in map_file.parts():
        digest.update(f"{name}\0{image.shape}\0".encode())
        digest.update(np.asarray(image, "<f4").tobytes())
    return digest.hexdigest()


def _check_frame(view: NDArray[np.float64], frame: NDArray[np.float64]) -> None:
    if view.shape != (3,) or frame.shape != (3, 3):
        raise ValueError(f"view is {view.shape} and frame {frame.shape}, not (3,) and (3, 3)")
    if not np.isfinite(frame).all():
        raise ValueError("the frame is not finite")
    if not np.allclose(frame.T @ frame, np.eye(3), rtol=0.0, atol=_FRAME_TOLERANCE) or np.linalg.det(frame) < 0.0:
        raise ValueError("the frame is no rotation")
    if not np.allclose(frame[:, 2], view, rtol=0.0, atol=_FRAME_TOLERANCE):
        raise ValueError("the frame's third column is not the view")
