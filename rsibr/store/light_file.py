"""Environment of a bake as a multi-part OpenEXR file, float32, ZIP; see `rsibr.light.radiance.Light`.

Parts, in this order, by name:

- `light`: octahedral image;
- `image`: if the material has a delta lobe and the environment is an image, that latitude–longitude image with its axes
  (`rsibr:frame`, m33f, columns x, y, z in world coordinates);
- `level.01`, `level.02`, …: levels of the Gaussian pyramid, octahedral, with their standard deviation in radians
  (`rsibr:width`, float), if a lobe is glossy;
- `irradiance.0`, …: an irradiance map for each matte lobe, octahedral, indexed by the surface normal, with the weights
  of its bare and its coated cosine lobe in each channel (`rsibr:weights`, m33f, rows bare, coated, zeros);
- `delta`: lights without extent, one a column, if there are any: in the first row the unit direction to each (x, y, z
  in R, G, B), in the second its irradiance [W m⁻²];
- `ratio.NAME`: with such lights, for each lobe the ratio to its proxy, see `rsibr.lobes.proxy_ratio`.

Every picture of the sphere says how it is laid out: `rsibr:projection` (`octahedral` or `latlong`) and
`rsibr:orientation`, in words; `image` has OpenEXR's own attribute `envmap` besides.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from rsibr.errors import BakeError
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.environment_pyramid import level_resolution, level_widths
from rsibr.light.radiance import Irradiance, Light
from rsibr.lobes.proxy_ratio import NODES
from rsibr.store.exr import encode_parts, open_exr
from rsibr.store.map_file import FRAME_KEY

_PICTURE, _IMAGE, _LEVEL, _IRRADIANCE, _DELTA = "light", "image", "level.", "irradiance.", "delta"
_RATIO = "ratio."
_WIDTH_KEY, _WEIGHTS_KEY = "rsibr:width", "rsibr:weights"

OCTAHEDRAL: dict[str, Any] = {
    "rsibr:projection": "octahedral",
    "rsibr:orientation": (
        "world right-handed, +Y up; column i of R at x = 2(i+0.5)/R - 1, row j at y = 2(j+0.5)/R - 1, "
        "z = 1 - |x| - |y|; where z < 0, (x, y) = (sign(x)(1 - |y|), sign(y)(1 - |x|)); the direction is (x, y, z) "
        "normalised: +Z in the middle, -Z at the corners, -Y at the top"
    ),
}
"""Attributes of an octahedral picture."""

LATLONG: dict[str, Any] = {
    "envmap": OpenEXR.ENVMAP_LATLONG,
    "rsibr:projection": "latlong",
    "rsibr:orientation": (
        "in the axes of rsibr:frame, right-handed, +Y up; column i of W at u = (i+0.5)/W, row j of H at v = j/(H-1) "
        "from +Y to -Y; u = 0, 1/4, 1/2, 3/4 are -Z, +X, +Z, -X. OpenEXR's envmap has its columns at u = i/(W-1) "
        "instead: half a texel at the edges"
    ),
}
"""Attributes of a latitude–longitude picture in Mitsuba's convention."""

_LARGEST_SIDE = 2**15
_FRAME_TOLERANCE = 1e-5  # the header is float32
_NO_DELTA = np.zeros((2, 0, 3), np.float32)

_Images = dict[str, tuple[NDArray[np.float32], dict[str, Any]]]
"""Part name → its image and its own attributes."""


def encode_light(light: Light) -> bytes:
    """Bytes of the file: R, G, B, float32, ZIP; equal environments give equal bytes."""
    images = _images(light)
    display = _window(*np.max([image.shape for image, _ in images.values()], axis=0)[:2])  # one for all
    return encode_parts(
        (name, {"RGB": image}, {"displayWindow": display, **own, "dataWindow": _window(*image.shape[:2])})
        for name, (image, own) in images.items()
    )


def decode_light(data: bytes, where: str) -> Light:
    """Decode a file of `encode_light`; `where` names the file in an error.

    Raises
    ------
    BakeError
        If the bytes are not such a file, or are truncated or altered.
    """
    try:
        with open_exr(io.BytesIO(data), header_only=True) as file:
            _check_sizes([part.header for part in file.parts])
        with open_exr(io.BytesIO(data)) as file:
            parts = {part.name() or _PICTURE: (_pixels(part), part.header) for part in file.parts}
            light = _light_of(parts)  # closing the file empties the headers
    except (LookupError, RuntimeError, ValueError, TypeError, OSError, AttributeError, MemoryError) as error:
        raise BakeError("is no light of rsibr, or is truncated or altered", where=where) from error
    unsound = next((name for name, (image, _) in _images(light).items() if not np.isfinite(image).all()), None)
    if unsound is not None:
        raise BakeError(f"is no light of rsibr: part {unsound} holds NaN or Inf", where=where)
    return light


def is_negative(light: Light) -> bool:
    """Whether radiance or irradiance is negative anywhere."""
    parts = {name: image for name, (image, _) in _images(light).items()}
    if _DELTA in parts:
        parts[_DELTA] = parts[_DELTA][1]  # the first row are directions
    return any(bool((image < 0).any()) for image in parts.values())


def _check_sizes(headers: list[dict[str, Any]]) -> None:
    """Refuse sizes that no light has, before any pixel is decoded; ValueError."""
    for header in headers:
        low, high = (np.array(corner, np.int64) for corner in header["dataWindow"])
        plain = header["type"] == OpenEXR.scanlineimage and header["compression"] == OpenEXR.ZIP_COMPRESSION
        subsampled = any((channel.xSampling, channel.ySampling) != (1, 1) for channel in header["channels"])
        if not plain or subsampled or low.any() or not (high + 1 >= 1).all() or (high >= _LARGEST_SIDE).any():
            raise ValueError(f"a part of {high + 1 - low} texels from {low}")


def _images(light: Light) -> _Images:
    images: _Images = {_PICTURE: (light.picture, OCTAHEDRAL)}
    if light.image is not None:
        images[_IMAGE] = (light.image, {**LATLONG, FRAME_KEY: np.ascontiguousarray(light.frame, np.float32)})
    widths = level_widths(len(light.picture))
    for number, level in enumerate(light.levels, 1):
        images[f"{_LEVEL}{number:02d}"] = (level, {**OCTAHEDRAL, _WIDTH_KEY: float(widths[number])})
    for number, map_ in enumerate(light.irradiances):
        weights = np.zeros((3, 3), np.float32)
        weights[:2] = map_.weights
        images[f"{_IRRADIANCE}{number}"] = (map_.image, {**OCTAHEDRAL, _WEIGHTS_KEY: weights})
    if len(light.delta):
        images[_DELTA] = (np.stack([light.delta.directions, light.delta.irradiance]), {})
    images |= {f"{_RATIO}{name}": (table, {}) for name, table in light.proxy_ratios.items()}
    return images


def _light_of(parts: dict[str, tuple[NDArray[np.float32], dict[str, Any]]]) -> Light:
    """Light of the decoded parts; ValueError where they do not fit together."""
    picture = parts.pop(_PICTURE)[0]
    image, header = parts.pop(_IMAGE, (None, {}))
    delta = _delta_lights(parts.pop(_DELTA, (_NO_DELTA, {}))[0])
    levels = [pixels for name, (pixels, _) in parts.items() if name.startswith(_LEVEL)]
    width_of = {name: own[_WIDTH_KEY] for name, (_, own) in parts.items() if name.startswith(_LEVEL)}
    maps = [
        Irradiance(np.array(own[_WEIGHTS_KEY], np.float64)[:2], pixels)
        for name, (pixels, own) in parts.items()
        if name.startswith(_IRRADIANCE)
    ]
    ratios = {name.removeprefix(_RATIO): pixels for name, (pixels, _) in parts.items() if name.startswith(_RATIO)}
    _check(picture, levels, len(parts) - len(levels) - len(maps) - len(ratios))
    _check_names(picture, width_of, parts)
    frame = np.array(header[FRAME_KEY], np.float64) if image is not None else np.eye(3)
    if not np.allclose(frame.T @ frame, np.eye(3), rtol=0.0, atol=_FRAME_TOLERANCE) or np.linalg.det(frame) < 0.0:
        raise ValueError("the frame of the image is no rotation")
    if any(map_.image.shape[0] != map_.image.shape[1] or not np.isfinite(map_.weights).all() for map_ in maps):
        raise ValueError("an irradiance map is not square, or without weights")
    if any(table.shape != (NODES, NODES, 3) for table in ratios.values()):
        raise ValueError("a table of ratios has another size")
    return Light(picture, image, frame, tuple(levels), tuple(maps), delta, ratios)


def _delta_lights(pixels: NDArray[np.float32]) -> DeltaLights:
    directions, irradiance = pixels  # ValueError if there are not two rows
    if not (np.isfinite(pixels).all() and np.allclose(np.linalg.norm(directions, axis=1), 1, rtol=0, atol=1e-3)):
        raise ValueError("delta lights need unit directions")
    return DeltaLights(directions, irradiance)


def _check(picture: NDArray[np.float32], levels: list[NDArray[np.float32]], unknown: int) -> None:
    sizes = [level_resolution(len(picture), width) for width in level_widths(len(picture))[1:]]
    square = picture.shape[0] == picture.shape[1]
    if not square or unknown or [level.shape[:2] for level in levels] not in ([], [(size, size) for size in sizes]):
        raise ValueError(f"{picture.shape}, {[level.shape for level in levels]}, {unknown} unknown parts")


def _check_names(picture: NDArray[np.float32], width_of: dict[str, float], parts: Iterable[str]) -> None:
    """Levels and irradiance maps are numbered in order, and each level has the width of its place."""
    widths = {f"{_LEVEL}{k:02d}": width for k, width in enumerate(level_widths(len(picture))) if k}
    maps = [name for name in parts if name.startswith(_IRRADIANCE)]
    named = not width_of or (list(width_of) == list(widths) and np.allclose([*width_of.values()], [*widths.values()]))
    if not named or maps != [f"{_IRRADIANCE}{number}" for number in range(len(maps))]:
        raise ValueError(f"levels {width_of}, maps {maps}")


def _window(height: int, width: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    return np.zeros(2, np.int32), np.array([width - 1, height - 1], np.int32)


def _pixels(part: Any) -> NDArray[np.float32]:
    pixels: NDArray[np.float32] = part.channels["RGB"].pixels
    if pixels.ndim != 3 or pixels.dtype != np.float32:
        raise ValueError(f"{pixels.dtype} {pixels.shape}")
    return pixels
