"""`rsibr validate --object`: bakes by shape, options, one line for each mistake."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType

import mitsuba as mi
import pytest

from rsibr.cli.named_bakes import named_bakes
from rsibr.cli.options import parse_resolution
from rsibr.errors import InputError
from rsibr.shading.scenes.object_scene import ObjectScene


@pytest.fixture
def scene(monkeypatch):
    """Make `open_scene` give a sphere for any source."""
    module = ModuleType("rsibr.shading.scenes.scene_file")
    module.open_scene = lambda source: ObjectScene(source, {"ball": mi.load_dict({"type": "sphere"})})
    monkeypatch.setitem(sys.modules, "rsibr.shading.scenes.scene_file", module)
    return "ball.ply"


SMALL = ("--resolution", "16x12", "--rays", 4, "--samples", 64, "--method", "rsibr", "--occlusion", "off")


def test_an_object_is_judged_and_reported(shell, baked, scene, tmp_path):
    out = tmp_path / "report"
    ended = shell("validate", f"ball={baked}", "--object", scene, "--out", out, *SMALL, "--json")
    assert ended.code == 0, ended
    assert ended.json == json.loads((out / "object.json").read_text())
    assert ended.json["camera"]["width"] == 16
    assert list(ended.json["surfaces"]) == ["ball"]
    assert ended.json["methods"]["rsibr"]["open"]["whole"]["rel_mse"]["value"] < 1e-3
    shown = shell("validate", baked, "--object", scene, "--out", out, *SMALL, "--camera", "0,1,5")
    assert shown.code == 0, shown
    assert "visibility" in shown.stdout
    assert "report.html" in shown.stdout


def test_mistakes_are_one_line(shell, baked, scene, tmp_path):
    out = ("--out", tmp_path / "report")
    shell.refuses("validate", baked, baked, *out, says="2 bakes and no object")
    shell.refuses("validate", baked, baked, "--object", scene, *out, says="two bakes for all other shapes")
    shell.refuses("validate", f"bal={baked}", "--object", scene, *out, *SMALL, says="Did you mean 'ball'")
    shell.refuses("validate", baked, "--object", scene, *out, "--camera", "1,2", says="'1,2' is no point")
    shell.refuses("validate", baked, "--object", scene, *out, "--resolution", "0x3", says="no size of a picture")
    shell.refuses(
        "validate", baked, "--object", scene, *out, "--lookup", "pixl", says="--lookup: unknown lookup 'pixl'"
    )


def test_bakes_are_named_by_shape(tmp_path):
    odd = tmp_path / "a=b.rsibr"
    odd.mkdir()
    assert named_bakes(["body=x", "y"]) == {"body": Path("x"), "*": Path("y")}
    assert named_bakes([str(odd)]) == {"*": odd}
    assert named_bakes([f"body={odd}"]) == {"body": odd}
    for wrong in (["a=x", "a=y"], ["=x"], ["a="]):
        with pytest.raises(InputError):
            named_bakes(wrong)


def test_the_size_of_a_picture_is_one_number_or_two():
    assert parse_resolution("64") == (64, 64)
    assert parse_resolution("64x32") == parse_resolution("64×32") == (64, 32)
    for wrong in ("", "x", "64x", "1x2x3", "-4", "99999", "6.5"):
        with pytest.raises(InputError, match="no size of a picture"):
            parse_resolution(wrong)
