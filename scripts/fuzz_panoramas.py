"""Environment files with a known picture: Radiance and OpenEXR with any header that their formats allow, and damaged.

Each case knows what the file holds, by code of its own: an input that is read to another picture fails, and so does a
sound one that is refused, or one that must be refused and is not.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.scene.latlong import LatLong, read_latlong

Case = Callable[[], object]
Mutate = Callable[[random.Random, bytes], bytes]

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
SPACES = {
    "Rec.709": REC709,
    "Rec.2020": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "ACEScg": (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767),
    "ACES2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
    "Radiance": (0.640, 0.330, 0.290, 0.600, 0.150, 0.060, 0.3333, 0.3333),
    "Rec.709 of D50": (0.6484, 0.3309, 0.3212, 0.5979, 0.1559, 0.0660, 0.3457, 0.3585),
}
NO_SPACES = (
    (0.64, 0.33, 0.64, 0.33, 0.15, 0.06, 0.3127, 0.3290),
    (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.0),
    (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.8, 0.1),
    (0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.3127, 0.3290),
    (0.0,) * 8,
)
IRRELEVANT = ("# 32-bit_rle_xyze " + "y" * 80, "\tEXPOSURE=7", " FORMAT=32-bit_rle_xyze", "pcomb -s 2 FORMAT=x", "x=1")
IRRELEVANT += ("\tPRIMARIES= 0 0 0 0 0 0 0 0", "#EXPOSURE=3", "exposure=3", "VIEW= -vtv -vp 0 0 0", "é" * 3)
"""Lines of a Radiance header that change nothing."""

_XYZ_OF_REC709 = np.array(  # IEC 61966-2-1 from its primaries, to seven digits
    [[0.4123908, 0.3575843, 0.1804808], [0.2126390, 0.7151687, 0.0721923], [0.0193308, 0.1191948, 0.9505322]]
)
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
TOLERANCE = 2e-5
"""Of the largest channel: float32, and the digits of the matrices here."""


class Panoramas:
    """Makes environment files in a folder.

    Parameters
    ----------
    folder : Path
        Where they are written.
    mutate : callable
        Alters bytes.
    """

    def __init__(self, folder: Path, mutate: Mutate) -> None:
        self._folder, self._mutate = folder, mutate

    def targets(self) -> dict[str, Callable[[random.Random], Case]]:
        """Kinds of inputs by name, for `fuzz_inputs.Inputs`."""
        return {"radiance": self.radiance, "exr": self.exr}

    def radiance(self, rng: random.Random) -> Case:
        """A Radiance picture with a random header, order and encoding; three in ten are damaged."""
        shape = rng.choice([(4, 8), (5, 9), (1, 8), (3, 7), (6, 40), (2, 300), (8, 1)])
        texels = _texels(rng, shape)
        header, truth = _radiance_header(rng, _decoded(texels))
        data = header + _resolution_and_scanlines(rng, texels)
        return self._case(rng, "sky.hdr", data, truth)

    def exr(self, rng: random.Random) -> Case:
        """An OpenEXR file with random attributes, windows, layers and parts; three in ten are damaged."""
        path = self._folder / "written.exr"
        truth, layer = _write_exr(rng, path)
        return self._case(rng, "sky.exr", path.read_bytes(), truth, layer)

    def _case(
        self, rng: random.Random, name: str, data: bytes, truth: LatLong | None, layer: str | None = None
    ) -> Case:
        path = self._folder / name
        damaged = rng.random() < 0.3
        path.write_bytes(self._mutate(rng, data) if damaged else data)
        return lambda: _read(path, layer) if damaged else _compare(path, layer, truth)


def _read(path: Path, layer: str | None) -> LatLong:
    read = read_latlong(path, layer=layer)
    if not (np.isfinite(read.image).all() and (read.image >= 0.0).all()):
        raise AssertionError("a value that is no radiance was accepted")
    return read


def _compare(path: Path, layer: str | None, truth: LatLong | None) -> None:
    try:
        read = _read(path, layer)
    except InputError as error:
        if truth is not None:
            raise AssertionError(f"a sound file is refused: {error}") from error
        raise
    if truth is None:
        raise AssertionError("a file that cannot be obeyed is accepted")
    if read.image.shape != truth.image.shape or not np.isclose(read.turn, truth.turn):
        raise AssertionError(f"{read.image.shape} turned by {read.turn}, not {truth.image.shape} by {truth.turn}")
    error = np.abs(read.image - truth.image).max() / max(float(truth.image.max()), 1e-30)
    if not error <= TOLERANCE:
        raise AssertionError(f"the picture is {error:.2g} off: {read.notes}")


def _truth(image: NDArray[np.float64], turn: float = 0.0) -> LatLong:
    return LatLong(np.maximum(image, 0.0).astype(np.float32), 0, 0.0, turn)


def _conversion(space: tuple[float, ...], neutral: tuple[float, ...] | None = None) -> NDArray[np.float64]:
    """Matrix to Rec.709, with the white, or the neutral colour, adapted by Bradford's transform."""
    x, y = np.array(space[0::2]), np.array(space[1::2])
    columns = np.stack([x, y, 1.0 - x - y])[:, :3]
    to_xyz = columns * np.linalg.solve(columns, _white(space[6:]))
    seen, wanted = (_BRADFORD @ _white(point) for point in (neutral or space[6:], REC709[6:]))
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(wanted / seen) @ _BRADFORD
    return np.linalg.inv(_XYZ_OF_REC709) @ adapted @ to_xyz


def _white(point: tuple[float, ...]) -> NDArray[np.float64]:
    return np.array([point[0] / point[1], 1.0, (1.0 - point[0] - point[1]) / point[1]])


# Radiance


def _texels(rng: random.Random, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """RGBE texels with runs, whose mantissas no old run length (1, 1, 1, n) or new scan line (2, 2, …) can be."""
    random_bits = np.random.default_rng(rng.getrandbits(32))
    texels = random_bits.integers(3, 256, (*shape, 4), dtype=np.uint8)
    texels[..., 3] = random_bits.integers(120, 140, shape)
    texels[random_bits.random(shape) < 0.05] = 0
    repeated = np.maximum.accumulate(
        np.where(random_bits.random(shape) < rng.choice([0.1, 0.9]), np.arange(shape[1]), 0), axis=1
    )
    return np.take_along_axis(texels, repeated[..., None], axis=1)


def _decoded(texels: NDArray[np.uint8]) -> NDArray[np.float64]:
    exponents = texels[..., 3:].astype(np.float64)
    return np.where(exponents > 0, texels[..., :3] * 2.0 ** (exponents - 136.0), 0.0)


def _radiance_header(rng: random.Random, image: NDArray[np.float64]) -> tuple[bytes, LatLong | None]:
    lines, sound = [], True
    for _ in range(rng.choice([0, 0, 1, 2, 3])):
        exposure = 10.0 ** rng.uniform(-3, 3)
        lines.append(f"EXPOSURE={rng.choice(['', ' ', '  '])}{exposure!r}{rng.choice(['', ' '])}")
        image = image / exposure
    for _ in range(rng.choice([0, 0, 1, 2])):
        factors = [rng.uniform(0.5, 2.0) for _ in range(3)]
        lines.append("COLORCORR= " + rng.choice([" ", "\t", "  "]).join(map(repr, factors)))
        image = image / np.array(factors)
    if rng.random() < 0.4:
        space = rng.choice(list(SPACES.values()))
        lines.append("PRIMARIES= " + " ".join(f"{value:g}" for value in space))
        image = image @ _conversion(space).T
    if rng.random() < 0.1:
        lines.append(rng.choice(["GAMMA=1", "GAMMA=1.0", "PIXASPECT=0.5", "NCOMP=3", "CAPDATE= 2026:01:01 00:00:00"]))
    if rng.random() < 0.1:
        stated = any(line.startswith("PRIMARIES") for line in lines)  # the last line counts
        lines.append(
            rng.choice(
                ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=nan", "EXPOSURE=1e99", "EXPOSURE=", "EXPOSURE=1,5", "GAMMA=2.2"]
                + ["COLORCORR=1 1", "COLORCORR=1 0 1", "PRIMARIES=1 2 3", "FORMAT=32-bit_rle_xyze", "FORMAT=ascii"]
                + ["PRIMARIES=" + " ".join(map(repr, space)) for space in NO_SPACES if not stated]
            )
        )
        sound = False
    for _ in range(rng.choice([0, 0, 1, 100])):
        lines.append(rng.choice(IRRELEVANT))
    lines.append(f"FORMAT={rng.choice(['', ' '])}32-bit_rle_rgbe{rng.choice(['', ' '])}")
    rng.shuffle(lines)
    end = rng.choice(["\n", "\n", "\r\n"])
    head = [rng.choice(["#?RADIANCE", "#?RGBE", "#?"]), *lines, "", ""]
    return end.join(head).encode("latin-1"), _truth(image) if sound else None


def _resolution_and_scanlines(rng: random.Random, texels: NDArray[np.uint8]) -> bytes:
    height, width = texels.shape[:2]
    downward, rightward, upright = (rng.random() < 0.5 for _ in range(3))
    stored = texels[:: 1 if downward else -1, :: 1 if rightward else -1]
    axes = [f"{'-' if downward else '+'}Y {height}", f"{'+' if rightward else '-'}X {width}"]
    if not upright:
        stored, axes = np.swapaxes(stored, 0, 1), axes[::-1]
    kinds = [_flat, _old_runs] + ([_new_runs] if 8 <= stored.shape[1] < 2**15 else [])
    kind = rng.choice(kinds)
    return f"{' '.join(axes)}\n".encode() + b"".join(
        (rng.choice(kinds) if rng.random() < 0.1 else kind)(rng, line) for line in stored
    )


def _flat(_: random.Random, line: NDArray[np.uint8]) -> bytes:
    return line.tobytes()


def _old_runs(rng: random.Random, line: NDArray[np.uint8]) -> bytes:
    out = bytearray()
    at = 0
    while at < len(line):
        run = 1
        while at + run < len(line) and (line[at + run] == line[at]).all() and rng.random() < 0.99:
            run += 1
        out += line[at].tobytes()
        copies = run - 1
        while copies:
            out += bytes([1, 1, 1, copies & 255])
            copies >>= 8
        at += run
    return bytes(out)


def _new_runs(rng: random.Random, line: NDArray[np.uint8]) -> bytes:
    out = bytearray([2, 2, len(line) >> 8, len(line) & 255])
    for component in line.T.tolist():
        at = 0
        while at < len(component):
            if rng.random() < 0.02:
                out.append(0)  # no values
            run = 1
            while at + run < len(component) and component[at + run] == component[at] and run < 127:
                run += 1
            if run >= rng.choice([1, 2, 4]):
                out += bytes([128 + run, component[at]])
                at += run
            else:
                count = min(rng.randint(1, 128), len(component) - at)
                out += bytes([count, *component[at : at + count]])
                at += count
    return bytes(out)


# OpenEXR


def _write_exr(rng: random.Random, path: Path) -> tuple[LatLong | None, str | None]:
    """Write a file; return what it holds (None: to be refused), and the layer to ask for."""
    random_bits = np.random.default_rng(rng.getrandbits(32))
    height, width = rng.choice([(4, 8), (5, 9), (1, 1), (7, 3), (16, 33), (2, 64)])
    pictures = [random_bits.gamma(1.0, 1.0, (height, width, 3)) for _ in range(3)]
    kind = rng.choice([np.float32, np.float16])
    pictures = [picture.astype(kind).astype(np.float64) for picture in pictures]
    channels, image, layer = _channels(rng, pictures, kind)
    header, converted, sound = _attributes(rng, xyz="X" in channels)
    left, top = rng.choice([(0, 0), (-3, -2), (5, 7), (-(2**20), 2**20)])
    data = (np.array([left, top], np.int32), np.array([left + width - 1, top + height - 1], np.int32))
    display = data
    turn, windows = 0.0, rng.choice(["same"] * 4 + ["overscan", "part"])
    if windows == "overscan" and min(height, width) > 2:
        display = (data[0] + 1, data[1] - [0, 1])
        image = image[1:-1, 1:]
        sound = sound and "envmap" not in header
    elif windows == "part":
        display = (data[0] - [0, 1], data[1])
        sound = False
    if header.get("envmap") == OpenEXR.ENVMAP_CUBE:
        sound = False  # none of these shapes is a cube
    image = image @ converted.T
    if header.get("envmap") == OpenEXR.ENVMAP_LATLONG and width > 1:
        seam = (image[:, :1] + image[:, -1:]) / 2.0
        image, turn = np.concatenate([seam, image[:, 1:-1]], axis=1), np.pi / (width - 1)
    header |= {"dataWindow": tuple(data), "displayWindow": tuple(np.asarray(box, np.int32) for box in display)}
    parts = [OpenEXR.Part(dict(header), channels)]
    if rng.random() < 0.2:
        parts[0] = OpenEXR.Part(dict(header), channels, "main")
        parts.append(OpenEXR.Part(dict(header), {"Z": random_bits.random((height, width)).astype(np.float32)}, "depth"))
        layer = layer or rng.choice([None, "main"])
        sound = sound and not (layer is None and any("." in name for name in channels) and "R" in channels)
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    return (_truth(image, turn) if sound else None), layer


def _attributes(rng: random.Random, *, xyz: bool) -> tuple[dict[str, Any], NDArray[np.float64], bool]:
    header: dict[str, Any] = {
        "compression": rng.choice(
            [
                *(OpenEXR.NO_COMPRESSION, OpenEXR.RLE_COMPRESSION, OpenEXR.PIZ_COMPRESSION),
                *(OpenEXR.ZIPS_COMPRESSION, OpenEXR.ZIP_COMPRESSION),
            ]
        ),
        "type": OpenEXR.scanlineimage,
        "lineOrder": rng.choice([OpenEXR.INCREASING_Y, OpenEXR.DECREASING_Y]),
        "pixelAspectRatio": rng.choice([1.0, 0.5, 2.0]),
        "screenWindowWidth": rng.choice([1.0, 3.0]),
    }
    if rng.random() < 0.3:
        tiles = OpenEXR.TileDescription()
        tiles.xSize, tiles.ySize = rng.choice([(8, 8), (64, 64), (3, 5)])
        tiles.mode = OpenEXR.ONE_LEVEL
        header |= {"type": OpenEXR.tiledimage, "tiles": tiles}
    matrix, sound = np.eye(3), True
    if xyz:
        matrix = np.linalg.inv(_XYZ_OF_REC709)
    elif rng.random() < 0.5:
        space = rng.choice(list(SPACES.values()))
        neutral = rng.choice([None, None, (0.3127, 0.3290), (0.34567, 0.35850)])
        header |= {"chromaticities": space} | ({"adoptedNeutral": np.array(neutral, np.float32)} if neutral else {})
        matrix = _conversion(space, neutral)
    elif rng.random() < 0.2:
        name = rng.choice(
            ["lin_rec709_scene", "lin_rec2020_scene", "lin_ap1_scene", "srgb_rec709_scene", "unknown", "?"]
        )
        header["colorInteropID"] = name
        known = {"lin_rec2020_scene": "Rec.2020", "lin_ap1_scene": "ACEScg"}
        matrix = _conversion(SPACES[known.get(name, "Rec.709")])
        sound = name not in ("srgb_rec709_scene", "?")
    if rng.random() < 0.2:
        header["envmap"] = rng.choice([OpenEXR.ENVMAP_LATLONG, OpenEXR.ENVMAP_LATLONG, OpenEXR.ENVMAP_CUBE])
    if rng.random() < 0.1:
        name, value = rng.choice(
            [("chromaticities", space) for space in NO_SPACES if not xyz]
            + [("envmap", "cube"), ("colorInteropID", "data")]
        )
        header.pop("colorInteropID", None)
        header[name] = value
        sound = False
    return header, matrix, sound


def _channels(
    rng: random.Random, pictures: list[NDArray[np.float64]], kind: type
) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64], str | None]:
    """Channels of a file, the picture that is to be read, and the layer to ask for."""
    first, second, third = pictures
    plain = {name: _plane(first, i, kind) for i, name in enumerate("RGB")}
    if rng.random() < 0.3:
        plain["A"] = _plane(third, 0, kind)
    choice = rng.choice(["rgb", "rgb", "grey", "xyz", "layer", "root and layer", "two layers"])
    if choice == "grey":
        return {"Y": _plane(first, 0, kind)}, np.repeat(first[..., :1], 3, axis=2), None
    if choice == "xyz":
        return {name: _plane(first, i, kind) for i, name in enumerate("XYZ")}, first, None
    named = {f"sky.{name}": _plane(second, i, kind) for i, name in enumerate("RGB")}
    if choice == "layer":
        return named | {"Z": _plane(third, 0, kind)}, second, rng.choice([None, "sky"])
    if choice == "root and layer":
        layer = rng.choice([None, "sky", "RGB"])
        return plain | named, second if layer == "sky" else first, layer
    if choice == "two layers":
        other = {f"albedo.{name}": _plane(third, i, kind) for i, name in enumerate("RGB")}
        layer = rng.choice(["sky", "albedo"])
        return named | other, second if layer == "sky" else third, layer
    return plain, first, None


def _plane(picture: NDArray[np.float64], channel: int, kind: type) -> NDArray[Any]:
    return np.ascontiguousarray(picture[..., channel], dtype=kind)
