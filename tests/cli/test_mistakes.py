"""Whatever a user does wrong ends as one clear line and an exit code, never as a traceback."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from filelock import FileLock

from rsibr.store.manifest import read_manifest, write_manifest
from tests.cli.command import CONFIG, write_config
from tests.scene.maps import write_exr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["bak"], "Did you mean 'bake'"),
        (["bake"], "Missing argument 'CONFIG'"),
        (["bake", "x.toml", "--frsh"], "--fresh"),
        (["bake", "x.toml", "y.toml"], "y.toml"),
        (["reconstruct", "x"], "Missing option"),
        (["validate", "x", "--out", "y", "--views", "0"], "--views"),
        (["validate", "x", "--out", "y", "--views", "many"], "--views"),
        (["validate", "x", "--out", "y", "--views", "10001"], "--views"),
        (["validate", "x", "--out", "y", "--samples", "0"], "--samples"),
        (["validate", "x", "--out", "y", "--samples", str(10**30)], "--samples"),
        (["reconstruct", "x", "--view", "1,2,3", "--out", "y.exr", "--resolution", "big"], "--resolution"),
        (["--frobnicate"], "--frobnicate"),
    ],
)
@pytest.mark.parametrize("output", [[], ["--json"]])
def test_a_mistyped_command_line(shell, arguments, says, output):
    if output and len(arguments) == 1:
        pytest.skip("--json belongs to a command")
    ended = shell.refuses(*arguments, *output, says=says)
    assert "--help`" in ended.stderr


@pytest.mark.parametrize(
    ("replace", "by", "says"),
    [
        ("[material]", "[matrial]", "did you mean 'material'"),
        ('preset = "matte-lambert"', "", "give exactly one of preset, bsdf, file"),
        ('preset = "matte-lambert"', 'preset = "mate-lambert"', "did you mean 'matte-lambert'"),
        ('preset = "matte-lambert"', 'file = "gone.xml"', "gone.xml"),
        ('preset = "matte-lambert"', 'bsdf = {type = "blendbsdf"}', "nested BSDFs"),
        ('preset = "matte-lambert"', "preset = 3", "material.preset = 3"),
        ("resolution = 8", "resolution = 7", "map.resolution = 7"),
        ("resolution = 8", 'resolution = "8"', "map.resolution"),
        ("resolution = 8", "resolution = 0x" + "f" * 4000, "an integer of 16000 bits"),
        ("resolution = 8", "resolution = " + "9" * 5000, "not valid TOML"),
        ("resolution = 8", "resolution = " + "[" * 3000 + "]" * 3000, "nested too deeply"),
        ("resolution = 8", ".".join("a" * 3000) + " = 1", "nested too deeply"),
        ("samples = 16", "samples = 0", "sampling.samples = 0"),
        ("samples = 16", "sampels = 16", "did you mean 'sampling.samples'"),
        ("samples = 16", "samples = 16\ntarget_error = 0.1", "give one of samples and target_error, not both"),
        (
            "samples = 16",
            "target_error = 0.1\ntime_budget_s = 9",
            "give one of target_error and time_budget_s, not both",
        ),
        ("samples = 16", "target_error = 0", "sampling.target_error = 0"),
        ("[map]", "[budget]\nerror = 0.1\nseconds = 9\n[map]", "give exactly one of error, seconds"),
        ("[map]", "[budget]\n[map]", "give exactly one of error, seconds"),
        ("samples = 16", "target_error = 0.1\n[budget]\nerror = 0.1", "leave out sampling.target_error"),
        ('emitter = {type = "constant", radiance = 0.5}', 'emitter = {type = "constnt"}', "constnt"),
        ('emitter = {type = "constant", radiance = 0.5}', 'emitter = {type = "point"}', "no emitter at infinity"),
        ('emitter = {type = "constant", radiance = 0.5}', 'file = "gone.exr"', "gone.exr"),
        ('emitter = {type = "constant", radiance = 0.5}', 'file = "."', "is a folder"),
        ('emitter = {type = "constant", radiance = 0.5}', 'file = "a\\u0000b"', "environment.file"),
        ("[map]", '[views]\nfile = "gone.json"\n[map]', "gone.json"),
        ("[map]", "[map", "not valid TOML"),
    ],
)
def test_a_wrong_config(shell, tmp_path, replace, by, says):
    assert replace in CONFIG
    config = write_config(tmp_path, CONFIG.replace(replace, by))
    out = tmp_path / "out.rsibr"
    shell.refuses("bake", config, "--out", out, "--json", says=says)
    assert not out.exists()


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"\x00", b"a = 1"])
def test_a_config_that_is_none(shell, tmp_path, content):
    path = tmp_path / "config.toml"
    path.write_bytes(content)
    shell.refuses("bake", path, says=str(path))


@pytest.mark.parametrize("command", ["bake", "demo"])
def test_an_output_whose_name_the_system_cannot_hold(shell, tmp_path, command):
    config = [write_config(tmp_path, CONFIG)] if command == "bake" else []
    shell.refuses(command, *config, "--out", tmp_path / ("a" * 5000), says="File name too long")


def test_a_config_that_is_not_there_or_a_folder(shell, tmp_path):
    shell.refuses("bake", tmp_path / "gone.toml", says="there is no such config")
    shell.refuses("bake", tmp_path, says="is a folder")


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("map.resolution", "sets nothing"),
        ("=3", "sets nothing"),
        ("map.resolution=[", "not valid TOML"),
        ("map.resolution=" + "[" * 3000, "nested too deeply"),
        ("map.resolution=" + "9" * 5000, "map.resolution"),
        ("map.resolutoin=8", "did you mean 'map.resolution'"),
        ("map=8", "map should be a table"),
        ("map.resolution.x=8", "--set"),
        (".".join("a" * 3000) + "=1", "unknown key"),
    ],
)
def test_a_wrong_override(shell, config, tmp_path, override, says):
    shell.refuses("bake", config, "--out", tmp_path / "x", "--set", override, "--json", says=says)


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "[]", '{"directions": 3}', '{"directions": [[1, 2], [3]]}'])
def test_views_that_are_none(shell, config, tmp_path, text):
    (tmp_path / "views.json").write_text(text)
    shell.refuses(
        "bake", config, "--out", tmp_path / "x", "--set", f"views.file={tmp_path / 'views.json'}", says="views.json"
    )


def test_an_environment_with_a_nan_names_the_texel(shell, config, tmp_path):
    image = np.ones((8, 16, 3), np.float32)
    image[3, 5, 1] = np.nan
    write_exr(tmp_path / "sky.exr", image)
    sky = f"environment.file={tmp_path / 'sky.exr'}"
    ended = shell.refuses("bake", config, "--out", tmp_path / "x", "--set", sky, "--json")
    assert ended.json["error"]["what"] == "texel (row 3, column 5) is NaN in channel G"
    assert ended.json["error"]["where"] == str(tmp_path / "sky.exr")


def test_an_environment_that_is_truncated(shell, config, tmp_path):
    data = write_exr(tmp_path / "sky.exr", np.ones((64, 128, 3))).read_bytes()
    (tmp_path / "sky.exr").write_bytes(data[: len(data) // 2])
    shell.refuses(
        "bake", config, "--out", tmp_path / "x", "--set", f"environment.file={tmp_path / 'sky.exr'}", says="sky.exr"
    )


def test_an_out_that_holds_other_things(shell, config, tmp_path):
    shell.refuses("bake", config, "--out", tmp_path, says="other things in it")
    shell.refuses("bake", config, "--out", config, says="is a file")
    shell.refuses("bake", config, "--out", config / "below", says="config.toml")
    assert config.read_text() == CONFIG


def test_another_process_holds_the_lock(shell, config, baked):
    with FileLock(baked / ".lock"):
        shell.refuses("bake", config, "--out", baked, "--fresh", says="another bake is writing")


@pytest.mark.parametrize("view", ["0,0,0", "nan,1,1", "1,2", "1,2,3,4", "up", "", "inf,0,0", "1e999,0,0"])
@pytest.mark.parametrize("command", [["reconstruct", "--out", "x.exr"], ["validate", "--out", "x"]])
def test_a_view_that_is_none(shell, baked, tmp_path, monkeypatch, view, command):
    monkeypatch.chdir(tmp_path)
    shell.refuses(*command, baked, f"--view={view}", "--json", says="direction")
    assert not list(tmp_path.glob("x*"))


@pytest.mark.parametrize("resolution", [0, 7, 4097, -1, 10**20])
def test_a_resolution_out_of_range(shell, baked, tmp_path, resolution):
    shell.refuses("reconstruct", baked, "--view", "1,2,3", "--out", tmp_path / "x.exr", f"--resolution={resolution}")


def test_an_unknown_method(shell, baked, tmp_path):
    view = ["--view", "1,2,3"]
    shell.refuses("reconstruct", baked, *view, "--out", tmp_path / "x.exr", "--method", "cabral", says="cabral1999")
    shell.refuses("validate", baked, "--out", tmp_path / "x", "--method", "nearst", says="id you mean 'nearest'")


def test_a_map_that_cannot_be_written(shell, baked, tmp_path):
    for out, says in ((tmp_path, "is a folder"), ("", "is a folder"), ("/", "is a folder"), ("/dev", "is a folder")):
        shell.refuses("reconstruct", baked, "--view", "1,2,3", "--out", out, says=says)
    (tmp_path / "file").write_text("")
    below = tmp_path / "file" / "x.exr"
    shell.refuses("reconstruct", baked, "--view", "1,2,3", "--out", below, says="Not a directory")


def test_a_report_that_cannot_be_written(shell, baked, config):
    shell.refuses("validate", baked, "--out", config, says="is a file")
    shell.refuses("validate", baked, "--out", config / "below", says="is a file")


def both_readers(shell, bake, tmp_path, says):
    shell.refuses("reconstruct", bake, "--view", "1,2,3", "--out", tmp_path / "x.exr", "--json", says=says)
    shell.refuses("validate", bake, "--out", tmp_path / "x", "--json", says=says)


def test_what_is_no_bake(shell, config, tmp_path):
    both_readers(shell, tmp_path / "gone", tmp_path, "does not exist")
    (tmp_path / "notes.txt").write_text("")
    both_readers(shell, tmp_path / "notes.txt", tmp_path, "is a file")
    shell.refuses("reconstruct", config, "--view", "1,2,3", "--out", tmp_path / "x.exr", says="it is not baked")
    both_readers(shell, tmp_path, tmp_path, "no bake")


def unfinish(bake):
    """Take the last view back, as a killed bake leaves it."""
    path = bake / "manifest.json"
    manifest = read_manifest(path)
    write_manifest(path, manifest.with_views(manifest.views[-1].pending()))


def test_a_bake_that_is_not_finished(shell, baked, tmp_path):
    unfinish(baked)
    both_readers(shell, baked, tmp_path, "11 of 12 views")


def test_a_map_that_was_altered(shell, baked, tmp_path):
    file = baked / "maps" / "view_0003.exr"
    data = bytearray(file.read_bytes())
    data[-1] ^= 1
    file.write_bytes(data)
    both_readers(shell, baked, tmp_path, "truncated or altered")
    file.unlink()
    both_readers(shell, baked, tmp_path, "is missing")


def test_an_environment_that_changed_or_went(shell, baked, sky, tmp_path):
    kept = shutil.copy(sky, tmp_path / "kept.exr")
    try:
        write_exr(sky, np.full((4, 8, 3), 0.6))
        shell.refuses("validate", baked, "--out", tmp_path / "x", says="the environment has changed")
        sky.unlink()
        shell.refuses("validate", baked, "--out", tmp_path / "x", says="there is no such environment map")
    finally:
        shutil.copy(kept, sky)


def test_a_wrong_device(shell, config, tmp_path, monkeypatch):
    monkeypatch.setenv("RSIBR_DEVICE", "vulkan")
    shell.refuses("bake", config, "--out", tmp_path / "x", "--json", says="'vulkan' is no device")


def test_a_name_with_markup_is_shown_as_it_is(shell, config, tmp_path, monkeypatch):
    write_exr(tmp_path / "sky[red].exr", np.linspace(-0.1, 1.0, 96).reshape(4, 8, 3))
    monkeypatch.chdir(tmp_path)
    ended = shell("bake", config, "--out", tmp_path / "x", "--set", "environment.file=sky[red].exr")
    assert ended.code == 0, ended.stderr
    assert "note: sky[red]: 9 negative values clipped" in ended.stderr


def test_out_of_memory_is_the_machines_lack(shell, config, tmp_path, monkeypatch):
    def exhausted(*_, **__):
        raise MemoryError

    monkeypatch.setattr("rsibr.budget.bake.bake", exhausted)
    shell.refuses("bake", config, "--out", tmp_path / "x", "--json", code=3, says="out of memory")


def test_a_bug_of_ours_is_no_users_mistake(shell, config, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr("rsibr.budget.bake.bake", broken)
    with pytest.raises(ZeroDivisionError):
        shell("bake", config, "--out", tmp_path / "x")


def test_lobes_that_are_not_there(shell, baked, tmp_path):
    shell.refuses("validate", baked, "--out", tmp_path / "x", "--lobes", "--json", says="--lobes")


@pytest.mark.parametrize(
    "arguments",
    [["--camera", "1,2,3"], ["--rays", "4"], ["--object", "sphere", "--views", "3"], ["--object", "sphere", "--lobes"]],
)
def test_validate_refuses_options_of_its_other_kind(shell, tmp_path, arguments):
    shell.refuses("validate", "x", "--out", tmp_path / "y", *arguments, says="it has no effect here")
