"""Bakes of a stranger: manifests, map headers and files altered, and every checksum made to fit again.

Nothing but the meaning of what is read can then give an alteration away. The truth is known: where an altered bake is
accepted, what is reconstructed from it must be what is reconstructed from the unaltered one.
"""

from __future__ import annotations

import functools
import hashlib
import io
import json
import os
import random
import shutil
import socket
import stat
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from rsibr import backend
from rsibr.geometry.frame import view_frame
from rsibr.light.radiance import Light
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.store.bake import Bake, open_bake
from rsibr.store.light_file import encode_light
from rsibr.store.manifest import LIGHT_NAME, MANIFEST_NAME, canonical, checksum
from rsibr.store.map_file import MapFile, map_digest

CONFIG = """[environment]
emitter = {type = "sunsky", sun_scale = 0.0}
[material]
bsdf = {type = "roughplastic", alpha = 0.3, distribution = "ggx"}
[map]
resolution = 8
[sampling]
samples = 16
[effects]
view_dependence = "on"
"""
"""Two lobes, twelve views."""

METHODS = ("rsibr", "cabral1999")
VIEWS = ((1.0, 2.0, 3.0), (0.2, -1.0, 0.4))
SAME = 1e-5
"""Relative difference of two pictures that are the same but for the rounding of a header."""

FREE = ("albedo", "coefficients", "alpha")
"""Numbers of a lobe that nothing repeats: within their range they make another bake, whose truth is not known."""

ODD = [0, 1, -1, 2, 7, 13, 2**31, 2**53 + 1, 2**63, 10**30, 0.5, -0.5, 1e-320, 1e308, -1e308, 0.0, -0.0, True, False]
ODD += [None, "", "x", "mirror", "normal", "rgb", "../x", "/etc/passwd", "a\0b", "\n", "\x1b[2J", "é", "9" * 400]
ODD += [[], {}, [1], [[0, 1, 2]], {"a": 1}, "maps/view_0001.exr", "ab" * 32, "llvm_ad_spectral", [0.0, 0.0, 1.0]]

Case = Callable[[], object]
Json = Any


@dataclass(frozen=True)
class Alteration:
    """What was done to a bake, and whether the truth is known where it is accepted."""

    name: str
    known: bool = True


class BakeInputs:
    """Alterations of one bake in a folder of its own.

    Parameters
    ----------
    folder : Path
        Where the altered bake lies.
    bake : Path
        The unaltered one, from `stranger`.
    """

    def __init__(self, folder: Path, bake: Path) -> None:
        self.bake, self.path = bake, folder / "stranger.rsibr"

    def targets(self) -> dict[str, Callable[[random.Random], Case]]:
        """Kinds of inputs by name, for `fuzz_inputs.Inputs`."""
        return {
            "stranger-manifest": functools.partial(self._case, self.manifest),
            "stranger-map": functools.partial(self._case, self.map_headers),
            "stranger-light": functools.partial(self._case, self.light),
            "stranger-files": functools.partial(self._case, self.files, refused=True),
        }

    def _case(self, alter: Callable[[random.Random], Alteration], rng: random.Random, *, refused: bool = False) -> Case:
        shutil.rmtree(self.path, ignore_errors=True)
        shutil.copytree(self.bake, self.path)
        done = alter(rng)
        return lambda: self.judge(done, refused=refused)

    def judge(self, done: Alteration, *, refused: bool) -> None:
        """Read everything that is in the altered bake, and compare what is made of it; or see that it is `refused`."""
        bake = open_bake(self.path)
        if refused:
            raise AssertionError(f"accepted: {done.name}")
        for index in range(bake.view_count):
            bake.map(index)
        _ = bake.light
        found, wanted = pictures(bake), self.truth
        if done.known and not all(np.allclose(a, b, rtol=SAME, atol=SAME) for a, b in zip(found, wanted, strict=True)):
            worst = max(float(np.abs(a - b).max()) for a, b in zip(found, wanted, strict=True))
            raise AssertionError(f"wrong picture, by {worst:.3g}, accepted: {done.name}")

    @functools.cached_property
    def truth(self) -> list[np.ndarray]:
        """What is reconstructed from the unaltered bake."""
        return pictures(open_bake(self.bake))

    # --- Manifests ----------------------------------------------------------------------------------------------------

    def manifest(self, rng: random.Random) -> Alteration:
        """One to three values of the manifest altered, removed, repeated or exchanged."""
        body = read(self.path)
        names, known = [], True
        for _ in range(rng.choice([1, 1, 1, 2, 3])):
            place, name = _place(rng, body)
            names.append(f"{name}: {_alter(rng, place)}")
            known &= not any(part in FREE for part in name.split("."))
        if rng.random() < 0.5:  # whoever knows the format mends this hash, too
            with suppress(ValueError, TypeError, KeyError, RecursionError):
                body["config_hash"] = checksum(canonical(body["config"]))
        write(self.path, body, rng)
        return Alteration("; ".join(names), known)

    # --- Headers of maps ----------------------------------------------------------------------------------------------

    def map_headers(self, rng: random.Random) -> Alteration:
        """One map whose header, or two maps whose files, are not what the manifest says."""
        one, other = rng.sample(range(12), 2)
        file = self.path / "maps" / f"view_{one:04d}.exr"
        data, name = file.read_bytes(), f"view {one}: "
        kind = rng.randrange(4)
        if kind == 0:
            second = self.path / "maps" / f"view_{other:04d}.exr"
            file.write_bytes(second.read_bytes())
            if rng.random() < 0.7:
                second.write_bytes(data)
            name += f"exchanged with {other}"
        elif kind == 1:
            file.write_bytes(_flipped(rng, data, 1200))
            name += "bytes of the header"
        else:
            parts, done = _parts(data), []
            for _ in range(rng.choice([1, 1, 2])):
                with suppress(LookupError, TypeError, ValueError):  # an earlier change left nothing for this one
                    done.append(rng.choice(HEADER_CHANGES)(rng, parts))
            with suppress(Exception):  # what OpenEXR cannot write stays as it was
                file.write_bytes(_packed(_signed(parts) if rng.random() < 0.9 else parts))
            name += "; ".join(done)
        sign(self.path)
        return Alteration(name)

    # --- Environments -------------------------------------------------------------------------------------------------

    def light(self, rng: random.Random) -> Alteration:
        """The file of the environment, with headers or texels that none has."""
        file = self.path / LIGHT_NAME
        data = file.read_bytes()
        if rng.random() < 0.3:
            file.write_bytes(_flipped(rng, data, 1500))
            name = "bytes of the header"
        else:
            parts = _parts(data)
            name = rng.choice(LIGHT_CHANGES)(rng, parts)
            with suppress(Exception):
                file.write_bytes(_packed(parts))
        sign(self.path)
        return Alteration(name)

    # --- Files --------------------------------------------------------------------------------------------------------

    def files(self, rng: random.Random) -> Alteration:
        """A file of the bake that is a pipe, a device, a socket, a link or a folder."""
        names = [MANIFEST_NAME, LIGHT_NAME, "maps", "maps/view_0000.exr", "maps/view_0007.exr"]
        name = rng.choice(names)
        place, kept = self.path / name, self.path.parent / f"kept-{rng.randrange(10**9)}"
        place.rename(kept)
        kind = rng.choice(["pipe", "device", "socket", "link", "circle", "dangling", "folder", "zero"])
        if kind == "pipe":
            os.mkfifo(place)
        elif kind in ("device", "zero"):
            number = os.makedev(1, 3 if kind == "device" else 5)
            try:
                os.mknod(place, stat.S_IFCHR | 0o666, number)
            except PermissionError:  # only root makes devices
                place.symlink_to("/dev/null" if kind == "device" else "/dev/zero")
        elif kind == "socket":
            with socket.socket(socket.AF_UNIX) as made, suppress(OSError):
                made.bind(str(place))
        elif kind == "link":
            place.symlink_to(kept)
        elif kind == "circle":
            place.symlink_to(place.name)
        elif kind == "dangling":
            place.symlink_to("gone")
        else:
            place.mkdir()
        return Alteration(f"{name} is a {kind}", known=False)


def pictures(bake: Bake) -> list[np.ndarray]:
    """Maps of two views by two methods."""
    methods, frames = MethodSet(bake), [view_frame(view) for view in VIEWS]
    return [run(methods[name], frame, bake.resolution).image for frame in frames for name in METHODS]


def stranger(path: Path) -> Path:
    """Make the bake in `path` a quick one to read: its environment in 32² texels, signed again."""
    backend.use()
    found = open_bake(path).light
    side = len(found.picture) // 32
    picture = found.picture.reshape(32, side, 32, side, 3).mean(axis=(1, 3), dtype=np.float32)
    small = Light(np.ascontiguousarray(picture)).with_tables(glossy=True, matte=[m.weights for m in found.irradiances])
    (path / LIGHT_NAME).write_bytes(encode_light(small))
    sign(path)
    return path


def read(path: Path) -> Json:
    """Content of a manifest, without its checksum."""
    body = json.loads((path / MANIFEST_NAME).read_text("utf-8"))
    del body["checksum"]
    return body


def write(path: Path, body: Json, rng: random.Random | None = None) -> None:
    """Write a manifest with the checksum that fits, as the format documents it; now and then as JSON of its own."""
    try:
        text = json.dumps(body, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
        signed = {**body, "checksum": hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()}
        data = json.dumps(signed, indent=1, ensure_ascii=False) + "\n"
    except (TypeError, ValueError, RecursionError):
        return
    if rng is not None and rng.random() < 0.05:
        key = rng.choice(list(body))
        data = data.replace(f'"{key}"', f'"{key}": 0, "{key}"', 1)  # a key twice
    (path / MANIFEST_NAME).write_text(data, "utf-8", errors="surrogatepass")


def sign(path: Path) -> None:
    """Make every checksum and size fit the files."""
    body = read(path)
    for state in body["views"]:
        data = (path / state["file"]).read_bytes()
        state |= {"sha256": checksum(data), "bytes": len(data)}
    data = (path / LIGHT_NAME).read_bytes()
    body["light"] = {"sha256": checksum(data), "bytes": len(data)}
    write(path, body)


def _place(rng: random.Random, body: Json) -> tuple[Json, str]:
    """A table or list anywhere in the manifest, and its dotted name."""
    place, name = body, []
    for _ in range(rng.choice([0, 1, 1, 2, 2, 3, 4, 6])):
        items = place.items() if isinstance(place, dict) else enumerate(place)
        inner = [(key, value) for key, value in items if isinstance(value, dict | list) and value]
        if not inner:
            break
        key, place = rng.choice(inner)
        name.append(str(key))
    return place, ".".join(name)


def _alter(rng: random.Random, place: Json) -> str:
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    if not keys:
        return "nothing"
    kind = rng.randrange(7)
    return _rearrange(rng, place, keys, kind) if kind < 3 else _replace(rng, place, rng.choice(keys), kind)


def _rearrange(rng: random.Random, place: Json, keys: list[Any], kind: int) -> str:
    key, other = rng.choice(keys), rng.choice(keys)
    if kind == 0:
        del place[key]
        return f"{key} removed"
    if kind == 1 and isinstance(place, list):
        place.insert(rng.randrange(len(place) + 1), place[key])
        return f"{key} repeated"
    place[key], place[other] = place[other], place[key]
    return f"{key} and {other} exchanged"


def _replace(rng: random.Random, place: Json, key: Any, kind: int) -> str:
    if kind == 3 and isinstance(place[key], int | float):
        value = rng.choice([place[key] * 2, -place[key] - 1, place[key] + 1, str(place[key]), float(place[key])])
    elif kind == 4:
        place[key] = functools.reduce(lambda inner, _: [inner], range(rng.choice([3, 200, 5000])), 1)
        return f"{key} nested"
    elif kind == 5 and isinstance(place, dict):
        place[rng.choice(["x", "views", "\ud800", "a" * 3000])] = rng.choice(ODD)
        return "a key added"
    else:
        value = rng.choice([*ODD, float("nan"), float("inf")])
    place[key] = value
    return f"{key} = {str(value)[:40]!r}"


def _flipped(rng: random.Random, data: bytes, reach: int) -> bytes:
    result = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 8])):
        at = rng.randrange(min(reach, len(result)))
        result[at] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, result[at] ^ (1 << rng.randrange(8))])
    return bytes(result)


_Part = dict[str, Any]
"""Name, header and channels of a part."""


def _parts(data: bytes) -> list[_Part]:
    with OpenEXR.File(io.BytesIO(data)) as file:
        return [
            {
                "name": part.name(),
                "header": {k: v for k, v in part.header.items() if k not in ("channels", "chunkCount", "name")},
                "channels": {k: np.array(c.pixels) for k, c in part.channels.items()},
            }
            for part in file.parts
        ]


def _packed(parts: list[_Part]) -> bytes:
    stream = io.BytesIO()
    with OpenEXR.File([OpenEXR.Part(p["header"], p["channels"], p["name"]) for p in parts]) as file:
        file.write(stream)
    return stream.getvalue()


def _signed(parts: list[_Part]) -> list[_Part]:
    """Give all parts the digest of what they now say, where there is one."""
    with suppress(Exception):
        images = {p["name"]: next(iter(p["channels"].values())) for p in parts}
        coverage, variance = images.pop("coverage"), images.pop("variance", None)
        view, frame = (np.array(parts[0]["header"][f"rsibr:{key}"], np.float64) for key in ("view", "frame"))
        digest = map_digest(MapFile(view, frame, images, variance, coverage))
        for part in parts:
            part["header"]["rsibr:digest"] = digest
    return parts


def _turned(rng: random.Random, parts: list[_Part]) -> str:
    """Another view, or the same one rolled: consistent in all parts."""
    angle = rng.choice([1e-3, 0.1, 1.5, 3.1])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    rolled = rng.random() < 0.5
    for part in parts:
        frame = np.array(part["header"]["rsibr:frame"], np.float64)
        frame = frame @ turn if rolled else turn @ frame
        part["header"]["rsibr:frame"] = np.ascontiguousarray(frame, np.float32)
        part["header"]["rsibr:view"] = np.ascontiguousarray(frame[:, 2], np.float32)
    return f"{'rolled' if rolled else 'another view'} by {angle}"


def _odd_attribute(rng: random.Random, parts: list[_Part]) -> str:
    key = rng.choice(["rsibr:view", "rsibr:frame", "rsibr:digest", "software", "pixelAspectRatio", "screenWindowWidth"])
    value = rng.choice([np.full(3, np.nan, np.float32), np.zeros((3, 3), np.float32), "x", 7, 1e30, None])
    for part in parts if rng.random() < 0.7 else parts[:1]:
        if value is None:
            part["header"].pop(key, None)
        else:
            part["header"][key] = value
    return f"{key} = {value}"


def _renamed(rng: random.Random, parts: list[_Part]) -> str:
    part, name = rng.choice(parts), rng.choice(["diffuse", "coverage", "variance", "", "x", "rest", "../x", "a" * 300])
    old, part["name"] = part["name"], name
    return f"part {old} named {name[:20]!r}"


def _rearranged(rng: random.Random, parts: list[_Part]) -> str:
    kind = rng.choice(["shuffled", "dropped", "repeated", "exchanged"])
    if kind == "shuffled":
        rng.shuffle(parts)
    elif kind == "dropped":
        parts.pop(rng.randrange(len(parts)))
    elif kind == "repeated":
        parts.insert(rng.randrange(len(parts)), dict(rng.choice(parts)))
    else:
        parts[0]["name"], parts[1]["name"] = parts[1]["name"], parts[0]["name"]
    return kind


def _resized(rng: random.Random, parts: list[_Part]) -> str:
    side = rng.choice([1, 4, 7, 9, 16])
    for part in parts if rng.random() < 0.7 else parts[:1]:
        part["channels"] = {
            key: np.ascontiguousarray(np.resize(image, (side, side, *image.shape[2:])))
            for key, image in part["channels"].items()
        }
        window = (np.zeros(2, np.int32), np.full(2, side - 1, np.int32))
        part["header"] |= {"dataWindow": window, "displayWindow": window}
    return f"{side}²"


def _shifted(rng: random.Random, parts: list[_Part]) -> str:
    by = rng.choice([-3, 1, 100, 2**30])
    keys = rng.choice([("dataWindow",), ("displayWindow",), ("dataWindow", "displayWindow")])
    for part in parts:
        for key in keys:
            part["header"][key] = tuple(np.array(corner, np.int32) + np.int32(by) for corner in part["header"][key])
    return f"{keys} by {by}"


def _stored_otherwise(rng: random.Random, parts: list[_Part]) -> str:
    kind = rng.choice(["half", "integers", "compression", "channels", "tiled"])
    part = rng.choice(parts)
    images = part["channels"]
    if kind in ("half", "integers"):
        part["channels"] = {k: v.astype(np.float16 if kind == "half" else np.uint32) for k, v in images.items()}
    elif kind == "compression":
        choices = [OpenEXR.NO_COMPRESSION, OpenEXR.PIZ_COMPRESSION, OpenEXR.DWAA_COMPRESSION, OpenEXR.PXR24_COMPRESSION]
        part["header"]["compression"] = rng.choice(choices)
    elif kind == "tiled":
        part["header"] |= {"type": OpenEXR.tiledimage}
    else:
        part["channels"] = {rng.choice(["RGB", "Y", "Z", "RGBA", "depth"]): next(iter(images.values()))}
    return f"{part['name']} in {kind}"


def _poisoned(rng: random.Random, parts: list[_Part]) -> str:
    """Texels that no light has."""
    part = rng.choice(parts)
    value = rng.choice([np.nan, np.inf, -np.inf, -1e30])
    for image in part["channels"].values():
        image[rng.randrange(len(image)), rng.randrange(image.shape[1])] = value
    return f"{value} in {part['name']}"


def _other_width(rng: random.Random, parts: list[_Part]) -> str:
    part = rng.choice(parts)
    for key in ("rsibr:width", "rsibr:weights", "rsibr:frame"):
        if key in part["header"]:
            part["header"][key] = rng.choice([np.zeros((3, 3), np.float32), np.float32(3.0), 0.5, "x", float("nan")])
            return f"{key} of {part['name']}"
    return "nothing"


HEADER_CHANGES = (_turned, _odd_attribute, _renamed, _rearranged, _resized, _shifted, _stored_otherwise)
LIGHT_CHANGES = (_renamed, _rearranged, _resized, _shifted, _stored_otherwise, _poisoned, _other_width)
