"""`rsibr reconstruct`: one map or several, folders that it makes, and bakes that are not finished."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rsibr.store.manifest import read_manifest, write_manifest
from rsibr.store.map_file import read_map


def test_a_second_view_is_a_second_map(shell, baked, tmp_path):
    views = ["--view", "1,2,3", "--view=-1,0,0"]
    ended = shell("reconstruct", baked, *views, "--out", tmp_path / "new" / "v.exr", "--json")
    assert ended.code == 0, ended.stderr
    told = ended.json["maps"]
    assert [one["file"] for one in told] == [str(tmp_path / "new" / f"v_{n:04d}.exr") for n in (1, 2)]
    for one, view in zip(told, ((1, 2, 3), (-1, 0, 0)), strict=True):
        direction = np.array(view) / np.linalg.norm(view)
        np.testing.assert_allclose(read_map(one["file"]).view, direction, atol=1e-6)
        np.testing.assert_allclose(one["view"], direction, atol=1e-9)


def test_one_view_keeps_the_name_and_a_number_goes_where_it_is_asked_for(shell, baked, tmp_path):
    single = shell("reconstruct", baked, "--view", "1,2,3", "--out", tmp_path / "v.exr", "--json").json
    assert single["file"] == str(tmp_path / "v.exr")
    two = ["--view", "1,2,3", "--view", "3,2,1"]
    assert shell("reconstruct", baked, *two, "--out", tmp_path / "v-##-x.png").code == 0
    assert {path.name for path in tmp_path.glob("v-*")} == {"v-01-x.png", "v-02-x.png"}


def test_a_wrong_view_among_several_is_refused_before_any_is_made(shell, baked, tmp_path):
    views = ["--view", "1,2,3", "--view", "0,0,0"]
    shell.refuses("reconstruct", baked, *views, "--out", tmp_path / "v.exr", says="direction")
    assert not list(tmp_path.glob("v*"))


def test_an_unfinished_bake_serves_methods_that_read_no_maps(shell, baked, tmp_path):
    view = ["--view", "1,2,3", "--out", tmp_path / "v.exr"]
    whole = shell("reconstruct", baked, *view, "--method", "kautz2003")
    assert whole.code == 0, whole.stderr
    expected = read_map(tmp_path / "v.exr").layers["radiance"]
    path = baked / "manifest.json"
    manifest = read_manifest(path)
    write_manifest(path, manifest.with_views(manifest.views[-1].pending()))
    ended = shell("reconstruct", baked, *view, "--method", "kautz2003")
    assert ended.code == 0, ended.stderr
    np.testing.assert_allclose(read_map(tmp_path / "v.exr").layers["radiance"], expected, rtol=1e-3, atol=1e-6)
    for method in (["--method", "cabral1999"], []):
        shell.refuses("reconstruct", baked, *view, *method, says="11 of 12 views")


@pytest.mark.parametrize("damage", ["{", json.dumps({"schema": 1})])
def test_an_unreadable_manifest_is_refused_to_every_method(shell, baked, tmp_path, damage):
    (baked / "manifest.json").write_text(damage)
    out = ["--out", tmp_path / "v.exr"]
    shell.refuses("reconstruct", baked, "--view", "1,2,3", *out, "--method", "kautz2003", says="manifest.json")
