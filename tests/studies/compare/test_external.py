"""Maps of another program: where they lie, what their headers say, and each mistake in one line."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest

from rsibr.errors import InputError
from rsibr.geometry.frame import unit_view, view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.store.map_file import MapFile, write_map
from rsibr.studies.compare.external import External, common_frames, map_at, maps_of_scenes, parse_externals

SIDE = 8
VIEWS = [(0.0, 0.0, 1.0), (0.48, 0.6, 0.64)]


def write(path, view=None, frame=None, image=None, **channels):
    """Write an EXR as another program would: R, G, B and the attributes given."""
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    header |= {} if view is None else {"rsibr:view": np.asarray(view, np.float32)}
    header |= {} if frame is None else {"rsibr:frame": np.ascontiguousarray(frame, np.float32)}
    image = np.full((SIDE, SIDE, 3), 0.5, np.float32) if image is None else image
    path.parent.mkdir(parents=True, exist_ok=True)
    with OpenEXR.File(header, channels or {"RGB": image}) as file:
        file.write(str(path))
    return path


def read(place, scenes=None):
    return maps_of_scenes(External("theirs", place), scenes or {"paint-city": SIDE})


def refused(place, says, scenes=None):
    with pytest.raises(InputError, match=says) as error:
        read(place, scenes)
    assert error.value.where
    assert error.value.fix
    assert "\n" not in str(error.value)


def test_a_header_gives_view_or_frame(tmp_path):
    frame = view_frame(unit_view(VIEWS[1]))
    turned = frame @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    write(tmp_path / "a.exr", view=VIEWS[0])
    write(tmp_path / "b.exr", frame=turned, view=VIEWS[1])
    write(tmp_path / ".c.exr", view=(1, 0, 0))
    (tmp_path / "notes.txt").write_text("no map")
    a, b = read(tmp_path)["paint-city"]
    assert np.array_equal(a.frame, view_frame(VIEWS[0]))
    np.testing.assert_allclose(b.frame, turned, atol=1e-6)
    assert a.image.dtype == np.float32


def test_an_upright_frame_is_that_of_the_methods_to_the_last_bit(tmp_path):
    frame = view_frame(unit_view(VIEWS[1]))
    write(tmp_path / "a.exr", frame=frame)
    ((one,),) = read(tmp_path).values()
    assert np.array_equal(one.frame, view_frame(unit_view(one.frame[:, 2])))
    np.testing.assert_allclose(one.frame, frame, atol=1e-7)


def test_maps_of_reconstruct_are_read(tmp_path):
    image = np.arange(SIDE * SIDE * 3, dtype=np.float32).reshape(SIDE, SIDE, 3)
    frame = view_frame(unit_view(VIEWS[1]))
    coverage = texel_coverage(SIDE).astype(np.float32)
    write_map(tmp_path / "a.exr", MapFile(frame[:, 2].copy(), frame, {"radiance": image}, None, coverage))
    ((one,),) = read(tmp_path).values()
    assert np.array_equal(one.image, image)
    assert np.array_equal(map_at([one], one.frame).image, image)


@pytest.mark.parametrize("channels", ["RGBA", "apart", "half"])
def test_channels_of_other_programs_are_read(tmp_path, channels):
    image = np.random.default_rng(1).random((SIDE, SIDE, 4)).astype(np.float32)
    made = {
        "RGBA": {"RGBA": image},
        "apart": {name: np.ascontiguousarray(image[..., k]) for k, name in enumerate("RGB")},
        "half": {"RGB": np.ascontiguousarray(image[..., :3]).astype(np.float16)},
    }[channels]
    write(tmp_path / "a.exr", view=VIEWS[0], **made)
    ((one,),) = read(tmp_path).values()
    np.testing.assert_allclose(one.image, image[..., :3], rtol=1e-3 if channels == "half" else 0)


@pytest.mark.parametrize("place", ["folder", "file"])
def test_a_list_gives_the_views_of_plain_files(tmp_path, place):
    write(tmp_path / "maps" / "one.exr")
    write(tmp_path / "maps" / "two.exr")
    table = tmp_path / "maps" / ("views.csv" if place == "folder" else "list.csv")
    table.write_text("file, x, y, z\ntwo.exr, 0.48, 0.6, 0.64\none.exr, 0, 0, 1\n")
    two, one = read(table.parent if place == "folder" else table)["paint-city"]
    assert (two.file.name, one.file.name) == ("two.exr", "one.exr")
    np.testing.assert_allclose(two.view, VIEWS[1], atol=1e-9)


def test_each_scene_has_a_folder_or_list_of_its_own(tmp_path):
    scenes = {"paint-city": SIDE, "chalk-city": SIDE}
    write(tmp_path / "paint-city" / "a.exr", view=VIEWS[0])
    write(tmp_path / "more" / "b.exr")
    (tmp_path / "chalk-city.csv").write_text("file,x,y,z\nmore/b.exr,0,0,1\n")
    found = read(tmp_path, scenes)
    assert {name: [one.file.name for one in maps] for name, maps in found.items()} == {
        "paint-city": ["a.exr"],
        "chalk-city": ["b.exr"],
    }
    (tmp_path / "chalk-city.csv").unlink()
    refused(tmp_path, "no maps of the scene 'chalk-city'", scenes)


def test_mistakes_in_a_map_are_one_line(tmp_path):
    file = tmp_path / "a.exr"
    refused(tmp_path, "holds no EXR file")
    write(file)
    refused(tmp_path, "neither rsibr:view nor rsibr:frame")
    write(file, view=(0, 0, 2))
    refused(tmp_path, "has the length 2")
    write(file, view=(0, 0, np.nan))
    refused(tmp_path, "finite values")
    write(file, frame=np.diag([1.0, 1, -1]))
    refused(tmp_path, "no rotation")
    write(file, view=(1, 0, 0), frame=np.eye(3))
    refused(tmp_path, "the view is")
    write(file, view=VIEWS[0], image=np.zeros((SIDE, 2 * SIDE, 3), np.float32))
    refused(tmp_path, "is 16×8, and the maps compared are 8×8")
    write(file, view=VIEWS[0], Y=np.zeros((SIDE, SIDE), np.float32))
    refused(tmp_path, "has the channels Y in its first part")
    file.write_bytes(file.read_bytes()[:200])
    refused(tmp_path, "no whole OpenEXR file")


def test_nan_is_refused_only_where_the_disk_is(tmp_path):
    image = np.full((SIDE, SIDE, 3), 0.5, np.float32)
    image[0, 0] = np.nan
    write(tmp_path / "a.exr", view=VIEWS[0], image=image)
    read(tmp_path)
    image[4, 4, 1] = np.inf
    write(tmp_path / "a.exr", view=VIEWS[0], image=image)
    refused(tmp_path, "radiance is inf in row 4, column 4")


def test_mistakes_in_a_list_are_one_line(tmp_path):
    write(tmp_path / "a.exr", view=VIEWS[0])
    table = tmp_path / "views.csv"
    for text, says in (
        ("name,x,y,z\na.exr,0,0,1\n", "has no column file"),
        ("file,x,y,z\na.exr,0,0,north\n", "line 2.*not three numbers"),
        ("file,x,y,z\na.exr,0,0,1\nb.exr,0,1,0\n", "no such file"),
        ("file,x,y,z\na.exr,0,0,3\n", "has the length 3"),
        ("file,x,y,z\na.exr,0,1,0\n", "in the list and"),
        ("file,x,y,z\n,0,1,0\n", "names no file"),
        ("file,x,y,z\n", "holds no EXR file"),
    ):
        table.write_text(text)
        refused(tmp_path, says)
    table.write_bytes(b"\xff\xfe")
    refused(tmp_path, "not UTF-8")


def test_two_maps_of_one_view_are_refused(tmp_path):
    write(tmp_path / "a.exr", view=VIEWS[0])
    write(tmp_path / "b.exr", view=VIEWS[0])
    refused(tmp_path, "as does a.exr")


def test_all_external_systems_share_their_views(tmp_path):
    for name in ("one", "two"):
        for number, view in enumerate(VIEWS):
            write(tmp_path / name / f"{number if name == 'one' else 9 - number}.exr", view=view)
    maps = {name: read(tmp_path / name)["paint-city"] for name in ("one", "two")}
    frames = common_frames(maps)
    np.testing.assert_allclose([frame[:, 2] for frame in frames], VIEWS, atol=1e-7)
    assert map_at(maps["two"], frames[0]) is maps["two"][1]
    for pair in ({"one": maps["one"], "two": maps["two"][:1]}, {"one": maps["one"][:1], "two": maps["two"]}):
        with pytest.raises(InputError, match="has no map of the view"):
            common_frames(pair)
    write(tmp_path / "two" / "9.exr", frame=np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    with pytest.raises(InputError, match="in another frame"):
        common_frames({"one": maps["one"], "two": read(tmp_path / "two")["paint-city"]})


def test_names_are_given_once_and_are_no_methods(tmp_path):
    assert parse_externals([f"theirs={tmp_path}"]) == [External("theirs", tmp_path)]
    for texts, says in (
        ([str(tmp_path)], "no name with a folder"),
        ([f"a/b={tmp_path}"], "no name with a folder"),
        ([f"rsibr={tmp_path}"], "is the name of a method"),
        ([f"a={tmp_path}", f"a={tmp_path}"], "given twice"),
        ([f"a={tmp_path / 'nowhere'}"], "no such folder"),
    ):
        with pytest.raises(InputError, match=says):
            parse_externals(texts)


@pytest.mark.parametrize("kind", ["map", "list"])
def test_altered_files_are_maps_or_one_line(tmp_path, rng, kind):
    """Bytes are altered, cut and repeated: nothing but an InputError is raised."""
    file = write(tmp_path / "a.exr", view=VIEWS[0], frame=view_frame(VIEWS[0]))
    table = tmp_path / "views.csv"
    table.write_text("file,x,y,z\na.exr,0,0,1\n")
    altered = file if kind == "map" else table
    whole, refusals = altered.read_bytes(), 0
    for _ in range(300):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), rng.integers(1, 6)):
            data[place] = rng.integers(0, 256)
        cut = rng.integers(0, len(data)) if rng.random() < 0.3 else len(data)
        altered.write_bytes(bytes(data[:cut]))
        try:
            read(tmp_path)
        except InputError:
            refusals += 1
    assert refusals > 100
