"""Maps of another renderer as a bake."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rsibr
from rsibr.errors import BakeError, InputError
from rsibr.geometry.frame import view_frame
from rsibr.resources import scenes
from rsibr.store.manifest import read_manifest, write_manifest
from tests.capture.maps.mirror_maps import mirror_map, uneven


@pytest.fixture(scope="module")
def views():
    return uneven(12)


@pytest.fixture(scope="module")
def bake(views, tmp_path_factory):
    maps = [mirror_map(view, 32) for view in views]
    return rsibr.import_maps(maps, views, tmp_path_factory.mktemp("import") / "mirror.rsibr")


def test_a_stored_view_is_given_back(bake, views):
    for method in ("nearest", "blend", "cabral1999", "cabral1999-mesh"):
        found = rsibr.reconstruct(bake, views[3], method=method)
        inside = found.coverage == 1
        assert np.median(np.abs(found.image - mirror_map(views[3], 32))[inside]) < 0.02
        assert found.between_views


def test_the_methods_are_those_that_read_maps_alone(bake):
    assert list(rsibr.MethodSet(bake)) == ["nearest", "blend", "cabral1999", "cabral1999-mesh"]
    with pytest.raises(BakeError, match="captured, and 'rsibr' needs the light and the lobes"):
        rsibr.reconstruct(bake, (0, 0, 1), method="rsibr")


def test_there_is_nothing_to_validate_against(bake):
    with pytest.raises(BakeError, match="captured"):
        rsibr.validate(bake)


def test_what_was_made_is_recorded(bake):
    capture = read_manifest(bake.path / "manifest.json").capture
    assert capture.source == "import"
    assert capture.variance == "spread"
    assert capture.distances == (None,) * 12
    assert not capture.is_partial
    assert any("circumradius" in one for one in capture.notes)


def test_a_frame_that_is_not_upright_is_turned(views, tmp_path):
    turns = [Rotation.from_euler("z", 25 * k, degrees=True).as_matrix() for k in range(len(views))]
    frames = [view_frame(view) @ turn for view, turn in zip(views, turns, strict=True)]
    maps = [mirror_map(view, 64, frame=frame) for view, frame in zip(views, frames, strict=True)]
    bake = rsibr.import_maps(maps, frames, tmp_path / "turned.rsibr")
    for index in (0, 5):
        found = bake.map(index)
        inside = found.coverage == 1
        off = np.abs(found.radiance - mirror_map(views[index], 64))[inside]
        assert np.median(off) < 0.005


def test_a_known_light_serves_the_methods_that_need_no_more(views, tmp_path):
    maps = [mirror_map(view, 16) for view in views]
    sky = scenes() / "environments" / "studio.exr"
    bake = rsibr.import_maps(maps, views, tmp_path / "lit.rsibr", light=sky)
    assert bake.manifest.environment.name == "studio"
    assert not bake.light.is_black


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"maps": np.ones((12, 8, 9, 3))}, "shape"),
        ({"maps": np.full((12, 16, 16, 3), np.nan)}, "NaN"),
        ({"views": np.zeros((12, 3))}, "direction"),
        ({"views": np.ones((5, 3))}, "shape"),
        ({"views": np.ones((12, 3, 3))}, "rotation"),
        ({"variance": -np.ones((12, 16, 16, 3))}, "negative"),
        ({"coverage": np.full((12, 16, 16), 2.0)}, "coverage"),
        ({"names": ["one"]}, "names"),
        ({"gap_deg": 200.0}, "gap"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_in_one_line(views, tmp_path, change, what):
    given = {"maps": np.ones((12, 16, 16, 3)), "views": views, "out": tmp_path / "x.rsibr", **change}
    with pytest.raises(InputError) as caught:
        rsibr.import_maps(**given)
    assert what in str(caught.value)
    assert not (tmp_path / "x.rsibr").exists()


def test_an_altered_record_of_the_capture_is_refused(bake, tmp_path):
    capture = bake.manifest.capture.model_copy(update={"is_partial": True})
    (tmp_path / "x.rsibr").mkdir()
    manifest = bake.manifest.model_copy(update={"capture": capture})
    write_manifest(tmp_path / "x.rsibr" / "manifest.json", manifest)
    with pytest.raises(BakeError, match="is_partial"):
        rsibr.open_bake(tmp_path / "x.rsibr")


@pytest.mark.slow
def test_half_a_sphere_says_what_it_covers_and_flags_the_rest(tmp_path):
    views = [view for view in uneven(24) if view[1] > -0.2]
    bake = rsibr.import_maps([mirror_map(view, 16) for view in views], views, tmp_path / "half.rsibr")
    assert bake.manifest.capture.is_partial
    assert rsibr.reconstruct(bake, (0, 1, 0)).between_views
    below = rsibr.reconstruct(bake, (0.1, -1, 0))
    assert not below.between_views
    assert np.isfinite(below.image).all()
    health = rsibr.check(bake)
    assert health.trusted
    assert 0.2 < health.capture.covered < 0.6
