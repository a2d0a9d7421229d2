"""`rsibr bake` called again: it says that the bake is complete, or what it has done."""

from __future__ import annotations

import pytest

from rsibr.baking.scene import Scene
from tests.cli.command import write_config


def test_a_complete_bake_is_said_to_be_so_and_nothing_is_loaded(shell, tmp_path, monkeypatch):
    config, out = write_config(tmp_path), tmp_path / "b.rsibr"
    first = shell("bake", config, "--out", out)
    assert first.code == 0
    assert "already complete" not in first.stdout
    with monkeypatch.context() as patch:
        patch.setattr(Scene, "prepare", lambda *_: pytest.fail("prepared again"))
        again = shell("bake", config, "--out", out)
        told, before = (ended.stdout.splitlines()[0] for ended in (again, first))  # the last line tells the time
        assert told == before.replace(": ", ": already complete, ", 1)
        assert shell("bake", config, "--out", out, "--json").json["already_complete"]
    (out / "maps" / "view_0003.exr").unlink()
    assert not shell("bake", config, "--out", out, "--json").json["already_complete"]
    assert "already complete" not in shell("bake", config, "--out", out, "--fresh").stdout
