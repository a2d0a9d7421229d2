"""A bake of a stranger, whose checksums all fit: what it says of itself is held against itself, in one clear line."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.errors import BakeError, InputError
from rsibr.methods.reconstruction import reconstruct
from rsibr.scene.config import load_config
from rsibr.store.atomic import checksum
from rsibr.store.bake import open_bake
from rsibr.store.light_file import encode_light
from rsibr.store.manifest import LIGHT_NAME
from rsibr.store.map_file import MapFile, encode_map, read_map
from tests.cli.command import CONFIG, Shell, write_config
from tests.cli.test_processes import done
from tests.store import synthetic
from tests.store.test_manifest import forge

PLASTIC = CONFIG.replace('preset = "matte-lambert"', 'bsdf = {type = "roughplastic", alpha = 0.3}')


@pytest.fixture(scope="module")
def _made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stranger")
    return bake(write_config(folder, PLASTIC), out=folder / "x.rsibr").path


@pytest.fixture
def stranger(_made: Path, tmp_path: Path) -> Path:
    """A bake of two lobes in twelve views of 8²."""
    return Path(shutil.copytree(_made, tmp_path / "x.rsibr"))


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


def sign(path: Path) -> None:
    """Make all checksums and sizes of the bake fit its files."""

    def change(body: dict[str, Any]) -> None:
        for state in [*body["views"], body["light"]]:
            data = (path / state.get("file", LIGHT_NAME)).read_bytes()
            state |= {"sha256": checksum(data), "bytes": len(data)}

    forge(path / "manifest.json", change)


@contextlib.contextmanager
def within(seconds: float) -> Iterator[None]:
    """Fail where the block waits for something."""

    def late(*_: object) -> None:
        raise TimeoutError(f"not done within {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def rehash(body: dict[str, Any]) -> None:
    text = json.dumps(body["config"], sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    body["config_hash"] = checksum(text.encode())


FORGERIES: list[tuple[str, Callable[[dict[str, Any]], object]]] = [
    ("resolution", lambda b: b.update(resolution=2**31)),
    ("resolution: 16", lambda b: b.update(resolution=16)),
    ("resolution: 4", lambda b: b.update(resolution=4)),
    ("albedo: 0 angles", lambda b: b["lobes"][0].update(albedo=[])),
    ("albedo: out of range", lambda b: b["lobes"][0]["albedo"].__setitem__(3, [-0.5, 0, 0])),
    ("no roughness", lambda b: b["lobes"][1]["proxies"][0].update(alpha=-1.0)),
    ("alpha", lambda b: b["lobes"][1].update(alpha=0.9)),
    ("no delta lobe", lambda b: b["lobes"][1].update(proxies=[])),
    ("terms, not", lambda b: b["lobes"][1]["proxies"][0]["coefficients"].pop()),
    ("coefficients: out of range", lambda b: b["lobes"][0]["proxies"][0]["coefficients"].__setitem__(0, [-1.0, 0, 0])),
    ("name", lambda b: b["lobes"][0].update(name="../../outside")),
    ("share a name", lambda b: b["lobes"].append(b["lobes"][0])),
    ("not as planned", lambda b: b["plan"]["lobes"][0].update(own_views=12)),
    ("environment", lambda b: (b.update(config={}), rehash(b))),
    ("sampling.seed", lambda b: (b["config"]["sampling"].update(seed=-1), rehash(b))),
    ("map.resolution", lambda b: (b["config"]["map"].update(resolution="8"), rehash(b))),
    ("there are none, between 12 views", lambda b: b.update(triangles=[])),
    ("cover", lambda b: b["triangles"].pop()),
    ("counter-clockwise", lambda b: b["triangles"][0].reverse()),
    ("no unit vector", lambda b: [place.__setitem__(0, 7.0) for place in (b["directions"][3], b["views"][3]["view"])]),
    ("views that the config asks for", lambda b: (b["config"].update(views={"subdivision": 1}), rehash(b))),
    ("warp", lambda b: b["material"].update(warp="normal")),
    ("variant", lambda b: b.update(variant="llvm_ad_spectral")),
    ("variant", lambda b: b.update(variant="rm -rf")),
    ("identity.material.content", lambda b: b["identity"].pop("material")),
    ("identity.blocks", lambda b: b["sampling"].update(block=2)),
    ("identity.packages", lambda b: b["packages"].update(mitsuba="9.9")),
    ("wall_seconds", lambda b: b.update(wall_seconds=1e308)),
    ("seconds", lambda b: b["views"][0].update(seconds=-1.0)),
    ("bytes", lambda b: b["views"][0].update(bytes=str(b["views"][0]["bytes"]))),
    ("index", lambda b: b["views"][0].update(index=0.0)),
    ("done", lambda b: b["views"][0].update(done=1)),
    ("schema version True", lambda b: b.update(schema_version=True)),
    ("schema version 2", lambda b: b.update(schema_version=2)),
    ("plan", lambda b: b["plan"]["effects"].append(b["plan"]["effects"][0])),
    ("a" * 100, lambda b: b.update({"a" * 10_000: 1})),
    ("budget", lambda b: b.update(budget={"asked": {}})),
]


@pytest.mark.parametrize(("says", "change"), FORGERIES)
def test_what_contradicts_itself_is_one_clear_line(stranger, says, change):
    assert open_bake(stranger).view_count == 12
    forge(stranger / "manifest.json", change)
    with pytest.raises(BakeError) as refused:
        open_bake(stranger)
    line = str(refused.value)
    assert says in line
    assert str(stranger) in line
    assert line.isprintable()
    assert len(line) < 500


def test_without_triangles_one_map_is_not_enough_where_the_plan_needs_more(stranger):
    def first_alone(body: dict[str, Any]) -> None:
        body.update(triangles=[], directions=body["directions"][:1], views=body["views"][:1])

    forge(stranger / "manifest.json", first_alone)
    with pytest.raises(BakeError, match="the plan needs several views"):
        open_bake(stranger)


def test_another_covering_of_the_sphere_is_not_that_of_the_icosphere(stranger):
    """Two triangles that share an edge, divided by the other diagonal: they cover as much."""

    def flip(body: dict[str, Any]) -> None:
        a, b, c = body["triangles"][0]
        other = next(t for t in body["triangles"][1:] if {a, b} < set(t))
        (d,) = set(other) - {a, b}
        body["triangles"] = [t for t in body["triangles"] if t not in (body["triangles"][0], other)]
        body["triangles"] += [[a, d, c], [d, b, c]]

    forge(stranger / "manifest.json", flip)
    with pytest.raises(BakeError, match="not those of the config's icosphere"):
        open_bake(stranger)


def exchange(path: Path, one: int = 2, other: int = 5) -> None:
    files = [path / "maps" / f"view_{index:04d}.exr" for index in (one, other)]
    data = [file.read_bytes() for file in files]
    for file, content in zip(files, reversed(data), strict=True):
        file.write_bytes(content)
    sign(path)


def test_two_views_exchanged(stranger, shell, tmp_path):
    exchange(stranger)
    for command in (["reconstruct", "--view", "1,2,3", "--out", tmp_path / "x.exr"], ["check"]):
        shell.refuses(command[0], stranger, *command[1:], says="but view 2 of the manifest is")
    shell.refuses("validate", stranger, "--out", tmp_path / "v", says="view_0002.exr: shows the view")
    with pytest.raises(BakeError, match="but view 2 of the manifest is"):
        reconstruct(stranger, (1, 2, 3))


def test_views_exchanged_in_an_unfinished_bake_are_baked_again(tmp_path):
    synthetic.write(tmp_path, views=2)
    first, second = (tmp_path / "maps" / f"view_{index:04d}.exr" for index in range(2))
    data = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(data)

    def exchanged(body: dict[str, Any]) -> None:
        one, other = body["views"][:2]
        for key in ("sha256", "bytes"):
            one[key], other[key] = other[key], one[key]

    forge(tmp_path / "manifest.json", exchanged)
    assert synthetic.write(tmp_path) == [0, 1, 2, 3]


def altered_map(found: MapFile, kind: str) -> MapFile:
    if kind == "rolled":
        frame = np.ascontiguousarray(found.frame[:, [1, 0, 2]] * [1, -1, 1])
        return replace(found, frame=frame)
    if kind == "bigger":
        images = {name: image.repeat(2, 0).repeat(2, 1) for name, image in found.parts()}
        coverage, variance = images.pop("coverage"), images.pop("variance")
        return replace(found, layers=images, coverage=coverage, variance=variance)
    if kind == "one layer":
        return replace(found, layers={"radiance": found.radiance})
    if kind == "exchanged":
        return replace(found, layers=dict(reversed(found.layers.items())))
    return replace(found, variance=None)


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("rolled", "another frame than view 4"),
        ("bigger", "has 16² texels, but 8² in the manifest"),
        ("one layer", "has the parts radiance, variance, coverage, not diffuse"),
        ("exchanged", "has the parts glossy"),
        ("no variance", "has the parts"),
    ],
)
def test_a_map_that_is_not_what_the_manifest_says(stranger, kind, says):
    file = stranger / "maps" / "view_0004.exr"
    file.write_bytes(encode_map(altered_map(read_map(file), kind)))
    sign(stranger)
    with pytest.raises(BakeError, match=says):
        open_bake(stranger)


def test_a_header_that_claims_more_texels_than_memory_holds_is_read_no_further(stranger, capfd):
    file = stranger / "maps" / "view_0004.exr"
    data = file.read_bytes()
    window = np.array([0, 0, 7, 7], "<i4").tobytes()
    file.write_bytes(data.replace(window, np.array([0, 0, 2**14, 2**14], "<i4").tobytes()))
    sign(stranger)
    with within(10), pytest.raises(BakeError, match=r"view_0004\.exr: is not an OpenEXR map of rsibr"):
        open_bake(stranger)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_an_environment_that_holds_no_radiance(stranger, value):
    light = open_bake(stranger).light
    picture = light.picture.copy()
    picture[1, 2, 0] = value
    (stranger / LIGHT_NAME).write_bytes(encode_light(replace(light, picture=picture)))
    sign(stranger)
    with pytest.raises(BakeError, match=r"light\.exr: .*(NaN or Inf|negative)"):
        reconstruct(stranger, (1, 2, 3))


@pytest.mark.parametrize("name", ["manifest.json", LIGHT_NAME, "maps/view_0003.exr"])
@pytest.mark.parametrize("kind", ["pipe", "link outside", "link in a circle", "folder"])
def test_a_file_that_is_none_is_refused_and_not_waited_for(stranger, tmp_path, name, kind):
    place = stranger / name
    place.rename(tmp_path / "outside")
    if kind == "pipe":
        os.mkfifo(place)
    elif kind == "folder":
        place.mkdir()
    else:
        place.symlink_to(tmp_path / "outside" if kind == "link outside" else place.name)
    with within(10), pytest.raises(BakeError, match=r"x\.rsibr.*: (is a|cannot be read)"):
        open_bake(stranger)


def test_a_pipe_in_place_of_a_config_or_of_its_views_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    with within(10), pytest.raises(InputError, match="a named pipe, not a file"):
        load_config(tmp_path / "pipe.toml")
    config = write_config(tmp_path, CONFIG + '[views]\nfile = "pipe.toml"\n')
    with within(10), pytest.raises(InputError, match="a named pipe, not a file"):
        bake(config, out=tmp_path / "x.rsibr")


def test_names_of_a_stranger_do_not_reach_the_terminal_as_controls(stranger, shell):
    forge(stranger / "manifest.json", lambda body: body["material"].update(name="\x1b[2J\nx", notes=["\x1b]0;owned\a"]))
    forge(stranger / "manifest.json", lambda body: body["identity"]["material"].update(name="\x1b[2J\nx"))
    assert "\x1b" not in shell("check", stranger).stdout
    from rsibr.cli.console import note_peculiarities

    note_peculiarities(open_bake(stranger))
    assert "\x1b" not in shell._capsys.readouterr().err


@pytest.mark.parametrize(("target", "count"), [("stranger-manifest", 12), ("stranger-map", 12), ("stranger-files", 20)])
def test_some_alterations_of_the_fuzzing(stranger, monkeypatch, target, count):
    """An accepted one must give the picture of the unaltered bake; `make fuzz` tries thousands."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "scripts"))
    from fuzz import ending
    from fuzz_bakes import BakeInputs

    kinds = BakeInputs(stranger.parent, stranger.rename(stranger.with_name("whole.rsibr"))).targets()
    found = [ending(kinds[target](random.Random(f"{target}/{number}"))) for number in range(count)]
    assert [detail for outcome, detail in found if outcome not in ("accepted", "refused")] == []
    assert "refused" in {outcome for outcome, _ in found}


# --- Streams ----------------------------------------------------------------------------------------------------------

MISTAKE = ("reconstruct", "x", "--view=up", "--out", "x.exr", "--json")
"""A command that fails before it loads anything heavy."""


@pytest.mark.parametrize("closed", [(1,), (2,), (0, 1, 2)])
def test_streams_that_are_closed_are_no_failure(closed):
    """And no file of ours takes their number: a library that prints would write into it."""

    def close() -> None:
        for descriptor in closed:
            os.close(descriptor)

    code, out, err = done(*MISTAKE, preexec_fn=close)
    assert code == 2
    assert (out == "") == (1 in closed)
    assert (err == "") == (2 in closed)
    assert err.count("\n") <= 1


def test_an_error_keeps_its_code_where_no_one_listens():
    reader, writer = os.pipe()
    os.close(reader)
    assert done(*MISTAKE, stdout=writer, stderr=writer)[0] == 2
    os.close(writer)


def test_names_with_newlines_and_bytes_are_shown_in_one_line(tmp_path):
    name = os.fsdecode(b"a\nb\xff\xf0\x9f\x98\x80.exr")
    code, out, err = done("reconstruct", "x", "--view=1,2,3", "--out", tmp_path / name / name)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert "b\\udcff" in err
    assert str(BakeError("is missing", where="a\nb\x1b[2J")) == "a\\nb\\x1b[2J: is missing"


def test_a_working_folder_that_is_gone(tmp_path):
    place = tmp_path / "gone"
    place.mkdir()
    code, _, err = done(*MISTAKE[:-1], preexec_fn=lambda: (os.chdir(place), place.rmdir()))
    assert (code, err) == (2, "error: the working folder no longer exists. Change to another one\n")
