"""The inputs that `fuzz.py` feeds to everything that reads: each a function of the target, the seed and its number."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
import string
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.font_manager  # noqa: F401  # makes its cache folder now, not while writing is watched
import numpy as np
import OpenEXR
from fuzz_bakes import BakeInputs
from fuzz_objects import Objects
from fuzz_panoramas import Panoramas

from rsibr.cli import app as command_line
from rsibr.errors import InputError
from rsibr.geometry.projections.faces import FACES
from rsibr.geometry.projections.projection import projection_names
from rsibr.resources import scenes
from rsibr.scene.config import Config, EnvironmentConfig, MaterialConfig, ViewsConfig, load_config, parse_config
from rsibr.scene.environment import load_environment
from rsibr.scene.material import PRESETS, load_material
from rsibr.scene.views import load_viewpoints
from rsibr.store.bake import open_bake
from rsibr.store.manifest import canonical, checksum

CONFIG = """[environment]
emitter = {type = "constant", radiance = 0.5}
rotation_deg = 30.0
scale = 2.0
[material]
preset = "matte-lambert"
warp = "auto"
[views]
subdivision = 0
[map]
resolution = 8
[sampling]
samples = 16
seed = 0
"""
ODD_NUMBERS = [0, 1, -1, 2, 8, 2**31, 2**63, 2**64, 10**40, 0.0, -0.0, 0.5, 1e-45, 1e38, 1e39, 1e308, -1e308]
ODD_TEXTS = [
    "",
    ".",
    "..",
    "/",
    "\0",
    "\n",
    "é",
    "[red]",
    "${HOME}",
    "~",
    "~nobody",
    "$(id)",
    "-",
    "%s",
    "{}",
    "a" * 300,
]
BSDFS = [
    "diffuse",
    "conductor",
    "roughconductor",
    "plastic",
    "roughplastic",
    "principled",
    "dielectric",
    "thindielectric",
]
BSDFS += ["roughdielectric", "blendbsdf", "twosided", "mask", "bumpmap", "normalmap", "null", "measured", "pplastic"]
BSDFS += ["hair", "principledthin", "retarder", "polarizer", "circular", "scene", "sphere", "path", "envmap", "merge"]
EMITTERS = ["constant", "envmap", "sunsky", "timed_sunsky", "directional", "point", "spot", "area", "projector", "sky"]
PARAMETERS = ["reflectance", "alpha", "alpha_u", "roughness", "metallic", "specular", "int_ior", "ext_ior", "eta", "k"]
PARAMETERS += [
    "weight",
    "distribution",
    "material",
    "nonlinear",
    "opacity",
    "base_color",
    "clearcoat",
    "sheen",
    "spec_tint",
]
PARAMETERS += [
    "radiance",
    "irradiance",
    "filename",
    "scale",
    "to_world",
    "turbidity",
    "sun_direction",
    "albedo",
    "direction",
]
PARAMETERS += ["nested", "nested_2", "sun_scale", "sky_scale", "latitude", "hour", "sun_aperture", "type", "id", "bsdf"]
KEYS = [
    "environment",
    "material",
    "views",
    "map",
    "sampling",
    "file",
    "emitter",
    "bsdf",
    "preset",
    "warp",
    "scale",
    "x",
]
KEYS += ["faces", "projection", "rotation_deg", "subdivision", "resolution", "samples", "seed"]

SOUND = {
    "environment": {
        "rotation_deg": [0.0, -90.0, 1e9],
        "scale": [1.0, 1e-30, 5],
        "file": ["a.exr"],
        "faces": ["sky_{face}.exr", dict.fromkeys(FACES, "sky.exr"), {"px": "a.exr"}],
        "projection": ["cube", "polar", "sphere-map"],
    },
    "material": {"warp": ["auto", "mirror", "normal"], "preset": list(PRESETS)},
    "views": {"subdivision": [0, 1, 5]},
    "map": {"resolution": [8, 4096]},
    "sampling": {"samples": [4, 2**24], "seed": [0, 2**63 - 1]},
}
"""Values that a config takes, so that not every input is refused for the first thing in it."""

PROJECTIONS = [*projection_names(), "cubes"]
"""Projections that an environment file is said to have."""

STRANGER = "stranger.rsibr"
"""Bake beside the small one, which `fuzz_bakes` alters."""

FAMILIES: list[Callable[[Path, Path], Any]] = [
    lambda folder, bake: BakeInputs(folder, bake.with_name(STRANGER)),
    lambda folder, _bake: Panoramas(folder, _mutated),
    lambda folder, _bake: Objects(folder, _mutated),
]
"""Further inputs, a file each: (folder, small bake) → object whose `targets()` are kinds by name, as those of `Inputs`.

A kind is fuzzed if `fuzz.TARGETS` gives it a share.
"""

Case = Callable[[], object]


class Inputs:
    """Makes the inputs of each target, in a folder of its own.

    Parameters
    ----------
    folder : Path
        Where the files are written; the only place that the code under test may write to.
    bake : Path
        A small bake to alter.
    """

    def __init__(self, folder: Path, bake: Path) -> None:
        self.folder, self.bake = folder, bake
        self._maps = _small_environments()
        self._xml = [(scenes() / "materials" / f"{name}.xml").read_bytes() for name in PRESETS]
        self.targets: dict[str, Callable[[random.Random], Case]] = {
            "config-bytes": self.config_bytes,
            "config-tables": self.config_tables,
            "override": self.override,
            "views": self.views,
            "environment": self.environment,
            "emitter": self.emitter,
            "bsdf": self.bsdf,
            "xml": self.xml,
            "bake": self.altered_bake,
            "command-line": self.command_line,
        }
        for family in FAMILIES:
            self.targets |= family(folder, bake).targets()

    def case(self, target: str, seed: int, number: int) -> Case:
        """Make input `number`; the same for the same arguments."""
        return self.targets[target](random.Random(f"{seed}/{target}/{number}"))

    def config_bytes(self, rng: random.Random) -> Case:
        """Bytes of a config file, altered."""
        path = self._file("config.toml", _mutated(rng, CONFIG.encode()))
        return lambda: load_config(path)

    def config_tables(self, rng: random.Random) -> Case:
        """A config as tables, with anything anywhere."""
        data: dict[str, Any] = {"environment": {"file": "sky.exr"}, "material": {"preset": "matte-lambert"}}
        for _ in range(rng.randint(1, 4)):
            name = rng.choice(list(SOUND))
            section = data.setdefault(name, {})
            if isinstance(section, dict) and rng.random() < 0.8:
                section.update([_sound(rng, name)])
            elif isinstance(section, dict) and rng.random() < 0.8:
                section[rng.choice(KEYS)] = _anything(rng)
            else:
                data[rng.choice(KEYS)] = _anything(rng)
        return lambda: _read_back(parse_config(data, self.folder))

    def override(self, rng: random.Random) -> Case:
        """One to three `--set`."""
        texts = [self._override(rng) for _ in range(rng.randint(1, 3))]
        path = self._file("config.toml", CONFIG.encode())
        return lambda: load_config(path, texts)

    def views(self, rng: random.Random) -> Case:
        """A file of views: valid JSON with odd numbers, or altered bytes."""
        count = rng.choice([0, 1, 3, 4, 6, 12])
        directions = [[rng.gauss(0, 1) for _ in range(3)] for _ in range(count)]
        document: dict[str, Any] = {"directions": directions}
        if rng.random() < 0.5:
            document["triangles"] = [[rng.randint(-1, count) for _ in range(3)] for _ in range(rng.randint(0, 20))]
        if directions and rng.random() < 0.5:
            rng.choice(directions)[rng.randrange(3)] = _anything(rng, 1)
        if rng.random() < 0.2:
            document[rng.choice(list(document))] = _anything(rng)
        text = json.dumps(document).encode()
        path = self._file("views.json", _mutated(rng, text) if rng.random() < 0.5 else text)
        return lambda: load_viewpoints(ViewsConfig(file=path))

    def environment(self, rng: random.Random) -> Case:
        """An EXR or HDR file, altered, in any projection or as all faces of a cube."""
        name = rng.choice(sorted(self._maps))
        path = self._file(name, _mutated(rng, self._maps[name]))
        projection = rng.choice([None, None, *PROJECTIONS])
        if rng.random() < 0.1:
            faces = dict.fromkeys(FACES, path)
            return lambda: load_environment(EnvironmentConfig(faces=faces, projection=projection))
        return lambda: load_environment(EnvironmentConfig(file=path, projection=projection))

    def emitter(self, rng: random.Random) -> Case:
        """An emitter as a table."""
        table = _plugin(rng, EMITTERS, 2)
        return lambda: load_environment(_section(EnvironmentConfig, {"emitter": table}, self.folder))

    def bsdf(self, rng: random.Random) -> Case:
        """A BSDF as a table."""
        table = _plugin(rng, BSDFS, 3)
        return lambda: load_material(_section(MaterialConfig, {"bsdf": table}, self.folder))

    def xml(self, rng: random.Random) -> Case:
        """A material as XML, altered."""
        path = self._file("material.xml", _mutated(rng, rng.choice(self._xml)))
        return lambda: load_material(MaterialConfig(file=path))

    def altered_bake(self, rng: random.Random) -> Case:
        """A bake with one file altered; now and then with checksums that fit again."""
        path = self.folder / "altered.rsibr"
        shutil.rmtree(path, ignore_errors=True)
        shutil.copytree(self.bake, path)
        if rng.random() < 0.5:
            _alter_manifest(rng, path / "manifest.json")
        else:
            _alter_map(rng, path)

        def read() -> None:
            bake = open_bake(path)
            for index in range(bake.view_count):
                bake.map(index)

        return read

    def command_line(self, rng: random.Random) -> Case:
        """Arguments, run as the shell would."""
        arguments = self._arguments(rng)

        def run() -> None:
            stdout, stderr = io.StringIO(), io.StringIO()
            sys.argv = ["rsibr", *arguments]
            with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
                try:
                    command_line.main()
                except SystemExit as ended:
                    code = ended.code
            _check_ending(arguments, int(code or 0), stdout.getvalue(), stderr.getvalue())

        return run

    def _arguments(self, rng: random.Random) -> list[str]:
        config = self._file("config.toml", CONFIG.encode() if rng.random() < 0.7 else _mutated(rng, CONFIG.encode()))
        names = [str(config), str(self.bake), str(self.folder), str(self.folder / "gone"), *ODD_TEXTS[:5]]
        options = {
            "bake": ["--out", "--set", "--fresh", "--json"],
            "reconstruct": ["--view", "--out", "--method", "--resolution", "--json"],
            "validate": ["--view", "--views", "--out", "--method", "--samples", "--json"],
            "demo": ["--help", "--ot"],
        }
        command = rng.choice(list(options))
        arguments = [command, rng.choice(names)]
        if command in ("reconstruct", "validate") and rng.random() < 0.5:
            arguments = [command, str(self.bake), "--out", str(self.folder / "out.exr"), "--view", "1,2,3"]
        for option in rng.choices(options[command], k=rng.randint(0, 4)):
            arguments.append(option)
            if option == "--set":
                arguments.append(self._override(rng))
            elif option == "--out":
                arguments.append(
                    rng.choice(["", ".", str(config), str(self.folder / "x"), str(self.folder / "gone/x")])
                )
            elif option == "--view":
                arguments.append(",".join(str(_scalar(rng)) for _ in range(rng.randint(1, 4))))
            elif option in ("--method", "--resolution", "--views", "--samples"):
                arguments.append(rng.choice(["nearest", "blend", "cabral1999", "8", "9", str(_scalar(rng))]))
        if rng.random() < 0.2:
            arguments[rng.randrange(len(arguments))] = rng.choice(ODD_TEXTS)
        return [argument.replace("\0", "0") for argument in arguments]  # no process can be given a zero byte

    def _override(self, rng: random.Random) -> str:
        if rng.random() < 0.6:
            section = rng.choice(list(SOUND))
            key, sound = _sound(rng, section)
            return f"{section}.{key}={sound}"
        key = ".".join(rng.choices(KEYS, k=rng.choice([1, 2, 2, 2, 3])))
        value = rng.choice([str(_scalar(rng)), json.dumps(_anything(rng)), "".join(rng.choices(string.printable, k=8))])
        text = f"{key}={value}"
        return _mutated(rng, text.encode()).decode(errors="replace") if rng.random() < 0.3 else text

    def _file(self, name: str, data: bytes) -> Path:
        path = self.folder / name
        path.write_bytes(data)
        return path


def stop_short_of_rendering() -> None:
    """Let a command line that is right end where the rendering would begin: that is the tests' business."""
    from rsibr.baking import baker  # noqa: PLC0415
    from rsibr.validation import validation  # noqa: PLC0415

    def refuse(*_: object, **__: object) -> None:
        raise InputError("as far as the fuzzing goes", where="fuzz")

    baker.bake_views = refuse
    validation.ReferenceRenderer = refuse


def _read_back(config: Config) -> None:
    if parse_config(config.to_dict(), Path("/")) != config:
        raise AssertionError("the config does not read back as it was")


def _section(kind: type[Any], data: dict[str, Any], base: Path) -> Any:
    """Validate as a config does, mistakes told as one."""
    whole = {"environment": {"file": "sky.exr"}, "material": {"preset": "matte-lambert"}}
    name = "environment" if kind is EnvironmentConfig else "material"
    return getattr(parse_config({**whole, name: data}, base), name)


def _check_ending(arguments: list[str], code: int, stdout: str, stderr: str) -> None:
    if code not in (0, 1, 2, 3):
        raise AssertionError(f"exit code {code}")
    if "Traceback" in stderr:
        raise AssertionError(stderr[-2000:])
    if code and not stderr.strip().splitlines()[-1].startswith("error: "):
        raise AssertionError(f"not one line: {stderr!r}")
    if "--json" in arguments and code:
        json.loads(stdout)
    if code:
        raise InputError(stderr.strip().splitlines()[-1])


def _sound(rng: random.Random, section: str) -> tuple[str, Any]:
    key = rng.choice(list(SOUND[section]))
    return key, rng.choice(SOUND[section][key])


def _scalar(rng: random.Random) -> Any:
    kind = rng.randrange(5)
    if kind == 0:
        return rng.choice([True, False])
    if kind == 1:
        return rng.choice(ODD_TEXTS)
    if kind == 2:
        return rng.choice([float("nan"), float("inf"), float("-inf")])
    return rng.choice(ODD_NUMBERS) if kind == 3 else rng.gauss(0.5, 1.0)


def _anything(rng: random.Random, depth: int = 3) -> Any:
    kind = rng.randrange(6) if depth else 0
    if kind == 4:
        return [_anything(rng, depth - 1) for _ in range(rng.randint(0, 4))]
    if kind == 5:
        return {rng.choice([*KEYS, *PARAMETERS]): _anything(rng, depth - 1) for _ in range(rng.randint(0, 4))}
    return _scalar(rng)


def _plugin(rng: random.Random, names: list[str], depth: int) -> dict[str, Any]:
    table: dict[str, Any] = {"type": rng.choice(names)}
    for _ in range(rng.randint(0, 4)):
        kind = rng.randrange(8)
        key = rng.choice(PARAMETERS[:-2] if rng.random() < 0.9 else PARAMETERS)
        if key == "type":
            continue
        if kind < 2 and depth:
            table[key] = _plugin(rng, BSDFS, depth - 1)
        elif kind == 2:
            table[key] = {
                "type": "rgb",
                "value": rng.choice([_scalar(rng), [rng.random() for _ in range(rng.randint(1, 4))]]),
            }
        elif kind == 3:
            table[key] = [rng.gauss(0, 1) for _ in range(rng.choice([1, 2, 3, 16]))]
        else:
            table[key] = rng.random() if kind > 5 else _scalar(rng)
    return table


def _mutated(rng: random.Random, data: bytes) -> bytes:
    """Flip, cut, repeat and insert bytes, one to eight times."""
    result = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 4, 8])):
        at = rng.randrange(len(result) + 1) if rng.random() < 0.5 else rng.randrange(min(len(result), 400) + 1)
        kind = rng.randrange(6)
        if kind == 0 and at < len(result):
            result[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            result[at : at + 1] = bytes([rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)])])
        elif kind == 2:
            del result[at : at + rng.choice([1, 2, 8, 100])]
        elif kind == 3:
            result[at:at] = bytes(rng.choices(range(256), k=rng.choice([1, 4, 16])))
        elif kind == 4:
            result[at:at] = result[at : at + rng.choice([1, 8, 64])] * rng.choice([1, 2, 50])
        else:
            result[at : at + 4] = rng.choice([b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\xff\xff\xff\xff", b"\0\0\0\0"])
    return bytes(result if rng.random() < 0.9 else result[: rng.randrange(len(result) + 1)])


def _alter_manifest(rng: random.Random, path: Path) -> None:
    if rng.random() < 0.5:
        path.write_bytes(_mutated(rng, path.read_bytes()))
        return
    body = json.loads(path.read_text())
    del body["checksum"]
    place: Any = body
    for _ in range(rng.randint(0, 3)):
        inner = [
            value for value in (place.values() if isinstance(place, dict) else place) if isinstance(value, dict | list)
        ]
        place = rng.choice(inner) if inner else place
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    if keys:
        place[rng.choice(keys)] = _anything(rng)
    with contextlib.suppress(ValueError):  # NaN: no manifest of ours could hold it
        body["checksum"] = checksum(canonical(body))
        path.write_text(json.dumps(body, indent=1, ensure_ascii=False) + "\n")


def _alter_map(rng: random.Random, path: Path) -> None:
    manifest = json.loads((path / "manifest.json").read_text())
    state = rng.choice(manifest["views"])
    file = path / state["file"]
    data = _mutated(rng, file.read_bytes())
    file.write_bytes(data)
    if rng.random() < 0.7:  # so that the EXR reader sees it
        state |= {"sha256": checksum(data), "bytes": len(data)}
        del manifest["checksum"]
        manifest["checksum"] = checksum(canonical(manifest))
        (path / "manifest.json").write_text(json.dumps(manifest, indent=1, ensure_ascii=False) + "\n")


def _small_environments() -> dict[str, bytes]:
    rng = np.random.default_rng(5)
    image = rng.gamma(1.0, 1.0, (8, 16, 3)).astype(np.float32)
    files = {}
    for name, pixels, compression in (
        ("zip.exr", image, OpenEXR.ZIP_COMPRESSION),
        ("piz.exr", image.astype(np.float16), OpenEXR.PIZ_COMPRESSION),
        ("plain.exr", image, OpenEXR.NO_COMPRESSION),
        ("dwaa.exr", image, OpenEXR.DWAA_COMPRESSION),
    ):
        stream = io.BytesIO()
        with OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, {"RGB": pixels}) as file:
            file.write(stream)
        files[name] = stream.getvalue()
    flat = b"".join(bytes([min(255, int(60 * v)) for v in texel] + [128]) for texel in image.reshape(-1, 3))
    files["flat.hdr"] = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + flat
    return files


def audit_writes(allowed: Path, found: list[str]) -> None:
    """Note in `found` every file that this process opens for writing, makes, renames or removes outside `allowed`."""
    roots = (str(allowed.resolve()), os.devnull)
    changes = (
        "os.mkdir",
        "os.remove",
        "os.rename",
        "os.rmdir",
        "os.truncate",
        "os.symlink",
        "os.link",
        "shutil.rmtree",
    )

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            writes = isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        else:
            writes = event in changes
        if writes and isinstance(arguments[0], str | bytes | os.PathLike):
            place = os.path.realpath(os.fsdecode(arguments[0]))
            if not place.startswith(roots) and "__pycache__" not in place:
                found.append(f"{event} {place}")

    sys.addaudithook(hook)
