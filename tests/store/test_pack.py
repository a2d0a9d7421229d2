"""Lights that bakes of one sky share, and bakes that are made self-contained again."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from rsibr.errors import BakeError, InputError
from rsibr.light.radiance import Light
from rsibr.store.bake import BakeWriter, open_bake
from rsibr.store.manifest import LIGHT_NAME
from rsibr.store.pack import pack
from tests.store.synthetic import COUNT, SECONDS, baked, content, manifest
from tests.store.test_light_file import same
from tests.store.test_manifest import forge


def light() -> Light:
    return Light(np.random.default_rng(3).random((16, 16, 3), dtype=np.float32))


def write(path, lights):
    with BakeWriter.open(path, manifest()) as writer:
        if not writer.has_light:
            writer.commit_light(light(), lights)
        for index in writer.pending:
            writer.commit(index, baked(COUNT, index), SECONDS)
    return path


@pytest.fixture
def batch(tmp_path):
    """A folder with two bakes, one of them a folder deeper, of one light."""
    for name in ("red.rsibr", "deeper/blue.rsibr"):
        write(tmp_path / "out" / name, tmp_path / "out" / "lights")
    return tmp_path / "out"


def test_bakes_of_one_sky_share_one_file(batch):
    (file,) = (batch / "lights").iterdir()
    for name, place in (("red.rsibr", "../lights"), ("deeper/blue.rsibr", "../../lights")):
        opened = open_bake(batch / name)
        assert not (batch / name / LIGHT_NAME).exists()
        assert opened.manifest.light.file == f"{place}/{file.name}"
        assert file.name == f"{opened.manifest.light.sha256}.exr"
        assert same(opened.light, light())


def test_a_batch_moves_as_a_whole(batch, tmp_path):
    batch.rename(tmp_path / "elsewhere")
    assert same(open_bake(tmp_path / "elsewhere" / "deeper" / "blue.rsibr").light, light())


@pytest.mark.parametrize("damage", ["missing", "altered", "pipe"])
def test_a_shared_light_that_is_missing_or_altered_is_one_clear_line(batch, damage):
    path, opened = batch / "red.rsibr", open_bake(batch / "red.rsibr")
    (file,) = (batch / "lights").iterdir()
    whole = file.read_bytes()
    if damage == "altered":
        file.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    else:
        file.unlink()
    if damage == "pipe":
        os.mkfifo(file)
    says = {"missing": r"is missing: the light of red\.rsibr, shared", "altered": "altered", "pipe": "a named pipe"}
    with pytest.raises(BakeError, match=rf"lights/\w{{64}}\.exr: .*{says[damage]}") as refused:
        open_bake(path)
    assert "\n" not in str(refused.value)
    with pytest.raises(BakeError, match=r"lights/\w{64}\.exr"):
        _ = opened.light
    with pytest.raises(BakeError):
        pack(path)
    if damage != "pipe":
        write(path, batch / "lights")
        assert file.read_bytes() == whole


@pytest.mark.parametrize(
    "place",
    [
        "../light.exr",
        "/etc/{sha}.exr",
        "../lights/../{sha}.exr",
        "../lights/{other}.exr",
        "lights/{sha}.exr",
        "../x/{sha}.exr",
    ],
)
def test_no_manifest_leads_to_another_file(batch, place):
    path = batch / "red.rsibr"
    sha = open_bake(path).manifest.light.sha256
    target = place.format(sha=sha, other="0" * 64)
    forge(path / "manifest.json", lambda body: body["light"].update(file=target))
    with pytest.raises(BakeError, match=r"light: its file is neither light\.exr nor \.\./lights/SHA256\.exr"):
        open_bake(path)


@pytest.mark.parametrize("lights", ["out/sky", "lights/deeper", "out/red.rsibr/lights"])
def test_a_folder_that_bakes_cannot_share_is_refused(tmp_path, lights):
    with pytest.raises(InputError, match="is no folder of lights"):
        write(tmp_path / "out" / "red.rsibr", tmp_path / lights)


def test_packed_in_place_and_as_a_copy_it_stands_alone(batch, tmp_path):
    blue, red = batch / "deeper" / "blue.rsibr", batch / "red.rsibr"
    before = content(blue)
    copy = pack(blue, out=tmp_path / "blue.rsibr")
    assert content(blue) == before
    assert pack(red).path == red
    shutil.rmtree(batch / "lights")
    for path in (copy.path, red):
        assert same(open_bake(path).light, light())
        assert open_bake(path).manifest.light.file == LIGHT_NAME
        assert {name: data for name, data in content(path).items() if name not in (LIGHT_NAME, "manifest.json")} == {
            name: data for name, data in before.items() if name != "manifest.json"
        }
    files = content(red)
    assert pack(red).path == red  # packed already
    assert content(red) == files


def test_a_copy_replaces_nothing(batch, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("three years of work")
    for out in (tmp_path / "mine", batch / "deeper" / "blue.rsibr"):
        before = content(out)
        with pytest.raises(BakeError, match=r"no bake|holds a bake"):
            pack(batch / "red.rsibr", out=out)
        assert content(out) == before


def test_the_command_packs(batch):
    command = [
        sys.executable,
        "-c",
        "from rsibr.cli.app import main; main()",
        "pack",
        str(batch / "red.rsibr"),
        "--json",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["views"] == COUNT
    assert (batch / "red.rsibr" / LIGHT_NAME).exists()


@pytest.mark.slow
def test_processes_that_store_one_light_at_once_leave_it_whole(tmp_path):
    """Each replaces the file as a whole with the same bytes."""
    script = (
        "import sys; from pathlib import Path\nfrom tests.store.test_pack import write\n"
        "write(Path(sys.argv[1]) / f'{sys.argv[2]}.rsibr', Path(sys.argv[1]) / 'lights')"
    )
    workers = [subprocess.Popen([sys.executable, "-c", script, str(tmp_path), str(k)]) for k in range(2)]
    assert [worker.wait(timeout=60) for worker in workers] == [0, 0]
    assert len(list((tmp_path / "lights").iterdir())) == 1
    assert all(same(open_bake(tmp_path / f"{k}.rsibr").light, light()) for k in range(2))
