"""Publishing of a bake: which files, of which maps, and what is refused."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rsibr
from rsibr.baking.baker import bake
from rsibr.errors import InputError
from rsibr.publishing.publish import publish, stem_of
from rsibr.publishing.registry import Encoded, format_of, formats, formats_of, register, unregister
from rsibr.publishing.view_source import ViewSource
from rsibr.store.bake import open_bake
from rsibr.store.described_maps import MapsInMemory
from rsibr.store.layers import layered
from tests.cli.command import CONFIG, Shell, write_config
from tests.publishing import programs, six_colours
from tests.store import synthetic

PLASTIC = CONFIG.replace('preset = "matte-lambert"', 'bsdf = {type = "roughplastic", alpha = 0.3}')
SMALL = {"latlong-exr": {"size": 8}, "dds": {"size": 4}}


@pytest.fixture(scope="module")
def plastic(tmp_path_factory):
    """A bake of two lobes in twelve views of 8²."""
    folder = tmp_path_factory.mktemp("plastic")
    return bake(write_config(folder, PLASTIC), out=folder / "red paint.rsibr")


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(monkeypatch, capsys)


def test_the_name_of_a_bake_begins_the_names_of_its_files():
    assert stem_of(Path("a/red paint.rsibr")) == "red_paint"
    assert stem_of(Path("a/..rsibr")) == "bake"
    assert stem_of(Path("x/@.rsibr")) == "bake"


def test_one_view_and_one_map_of_the_light(plastic, tmp_path):
    seen = []
    made = publish(
        plastic, (1, 2, 3), {**SMALL, "sh": {}}, tmp_path / "new" / "folder", on_progress=lambda *one: seen.append(one)
    )
    names = [file.name for file in made.files]
    assert names == [f"red_paint.{ending}" for ending in ("sh.json", "sh.txt", "latlong.exr", "dds", "dds.txt")]
    assert {file.name for file in (tmp_path / "new" / "folder").iterdir()} == set(names)
    assert (made.views, made.notes, seen) == (1, (), [(1, 2), (2, 2)])


def test_a_map_is_that_of_the_method(plastic, tmp_path):
    made = publish(plastic, (1, 2, 3), "mirror-ball-exr", tmp_path, method="cabral1999", resolution=16)
    expected = rsibr.reconstruct(plastic, (1, 2, 3), method="cabral1999", resolution=16)
    inside = expected.coverage >= 0.9
    np.testing.assert_array_equal(programs.pixels(made.files[0])[inside], expected.image[inside])


def test_all_views_are_the_stored_maps(plastic, tmp_path):
    made = publish(plastic, "all", ["mirror-ball-exr,half=false", "matcap-exr"], tmp_path)
    assert len(made.files) == 24
    assert made.files[6].name == "red_paint.view_0003.ball.exr"
    stored = plastic.map(3)
    inside = stored.coverage >= 0.9
    np.testing.assert_array_equal(programs.pixels(made.files[6])[inside], stored.radiance[inside])
    passes = programs.pixels(made.files[7])[inside]
    np.testing.assert_array_equal(passes[:, :3], stored.layers["diffuse"][inside])
    glossy = next(image for name, image in stored.layers.items() if name != "diffuse")
    np.testing.assert_array_equal(passes[:, 3:], glossy[inside])


def test_all_views_by_a_method_and_several_views(plastic, tmp_path):
    made = publish(plastic, "all", "mirror-ball-exr", tmp_path / "a", method="nearest")
    assert len(made.files) == 12
    made = publish(plastic, [(1, 2, 3), (0, 0, -1)], "mirror-ball-exr", tmp_path / "b")
    assert [file.name for file in made.files] == [f"red_paint.asked_000{k}.ball.exr" for k in range(2)]


def test_passes_of_a_method_add_up_to_its_map(plastic, tmp_path):
    made = publish(plastic, (1, 2, 3), ["mirror-ball-exr", "matcap-exr"], tmp_path)
    whole, passes = (programs.pixels(file) for file in made.files)
    np.testing.assert_allclose(passes[..., :3] + passes[..., 3:], whole, rtol=2e-3, atol=1e-4)
    assert passes[..., :3].max() > 0.01
    assert passes[..., 3:].max() > 0.01


@pytest.mark.slow
def test_equal_input_gives_equal_bytes(plastic, tmp_path):
    every = ",".join(name for name in formats() if name != "roughness-levels")
    one = publish(plastic, (1, 2, 3), f"{every},roughness-levels,size=32", tmp_path / "a")
    other = publish(open_bake(plastic.path), (1, 2, 3), f"{every},roughness-levels,size=32", tmp_path / "b")
    assert [file.name for file in one.files] == [file.name for file in other.files]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(one.files, other.files, strict=True))


def test_files_that_are_there_are_not_replaced_unless_told(plastic, tmp_path):
    (tmp_path / "red_paint.dds").write_text("mine")
    with pytest.raises(InputError, match=r"red_paint\.dds is there already"):
        publish(plastic, (1, 2, 3), SMALL, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["red_paint.dds"]
    assert (tmp_path / "red_paint.dds").read_text() == "mine"
    publish(plastic, (1, 2, 3), SMALL, tmp_path, fresh=True)
    assert (tmp_path / "red_paint.dds").read_bytes()[:4] == b"DDS "


def test_two_formats_do_not_write_one_file(plastic, tmp_path):
    register("other", summary="writes a file of another format's name", files=("dds",))(
        lambda view: Encoded({"dds": b""})
    )
    try:
        with pytest.raises(InputError, match=r"dds and other both write red_paint\.dds"):
            publish(plastic, (1, 2, 3), "dds,other", tmp_path / "out")
    finally:
        unregister("other")
    assert not (tmp_path / "out").exists()


def test_maps_that_hold_lobes_added_up_are_made_by_a_method(plastic):
    """Where further views store the sum of the lobes alone, passes of all views come from one source."""
    lobes = tuple(lobe.model_copy(update={"views": 6}) for lobe in plastic.manifest.lobes)
    mixed = MapsInMemory(plastic.path, plastic.manifest.model_copy(update={"lobes": lobes}), (), plastic.light)
    mixed = replace(mixed, maps=tuple(layered(plastic.map(k), lobes, k) for k in range(12)))
    found = ViewSource.of(mixed, "all", None, None, split=True)
    assert (found.method, len(found.notes)) == ("rsibr", 1)
    assert ViewSource.of(mixed, "all", None, None, split=False).method is None
    assert ViewSource.of(plastic, "all", None, None, split=True).method is None


def test_a_bake_of_one_layer_has_no_passes(tmp_path):
    synthetic.write(tmp_path / "x.rsibr")
    for views in ("all", (1, 2, 3)):
        with pytest.raises(InputError, match="does not know the lobes apart"):
            publish(tmp_path / "x.rsibr", views, "matcap-exr", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("views", "asked", "options", "says"),
    [
        ((1, 2, 3), "ktx", {}, "Did you mean 'ktx2'"),
        ((1, 2, 3), "ktx2,side=4", {}, "ktx2 has no option 'side'.*here are: size"),
        ((1, 2, 3), "ktx2,size=6", {}, "6 is no size.*power of two"),
        ((1, 2, 3), "latlong-exr,axes=cube", {}, "unknown axes 'cube'"),
        ((1, 2, 3), "roughness-levels,size=16", {}, "one level"),
        ((1, 2, 3), "ktx2,ktx2", {}, "named twice"),
        ((1, 2, 3), "", {}, "none is named.*There are: cube-exr"),
        ((0, 0, 0), "ktx2", {}, "no direction"),
        ("some", "ktx2", {}, "'some' is no view"),
        (None, "ktx2", {}, "no view is named"),
        ([], "ktx2", {}, "no direction"),
        ((1, 2, 3), "ktx2", {"method": "rsibrr"}, "unknown method 'rsibrr'"),
        ((1, 2, 3), "ktx2", {"resolution": 4}, "Give 8 to 4096"),
    ],
)
def test_what_is_refused(plastic, tmp_path, views, asked, options, says):
    with pytest.raises(InputError, match=says):
        publish(plastic, views, asked, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_refused(value):
    good = six_colours.view(16)
    image = good.image.copy()
    image[8, 8, 1] = value
    with pytest.raises(InputError, match="1 texels are not finite"):
        type(good)("x", "", "s", "m", good.frame, image, good.coverage)


@pytest.mark.parametrize("name", ["dds", "ktx2", "latlong-exr,half=true", "mirror-ball-exr,half=true"])
def test_half_floats_are_clamped_and_it_is_said(name):
    bright = six_colours.view(16, scale=1e5)
    (one,) = formats_of([name])
    notes = one.encode(bright).notes
    assert notes
    assert len(notes) == 1
    assert "beyond 65504 clamped, up to " in notes[0]
    assert one.encode(six_colours.view(16)).notes == ()


def test_a_clamped_half_is_the_largest_and_not_infinite(tmp_path):
    data = format_of("mirror-ball-exr", {"half": True}).encode(six_colours.view(16, scale=1e5)).files["ball.exr"]
    (tmp_path / "x.exr").write_bytes(data)
    assert programs.pixels(tmp_path / "x.exr").max() == 65504


def test_negative_radiance_is_kept_where_it_can_be(tmp_path):
    negative = six_colours.view(16, scale=-1.0)
    made = format_of("latlong-hdr").encode(negative)
    assert "values below 0 clipped, down to -0.9" in made.notes[0]
    (tmp_path / "x.exr").write_bytes(format_of("latlong-exr").encode(negative).files["latlong.exr"])
    assert programs.pixels(tmp_path / "x.exr").min() == pytest.approx(-0.9)


def test_radiance_files_round(tmp_path):
    """Mantissas of eight bits, to the nearest: half a step of the largest channel, which has no bias (4σ of a mean)."""
    from rsibr.publishing.radiance_bytes import encode_radiance

    image = np.random.default_rng(3).gamma(0.3, 2.0, (64, 128, 3)).astype(np.float32)
    image[0, 0] = 0
    (tmp_path / "x.hdr").write_bytes(encode_radiance(image, "x")[0])
    error = (programs.pixels(tmp_path / "x.hdr") - image) / np.maximum(image.max(axis=-1, keepdims=True), 1e-30)
    assert np.abs(error).max() <= 1 / 256
    own = np.take_along_axis(error, image.argmax(axis=-1)[..., None], axis=-1)
    assert abs(own.mean()) < 4 * own.std() / np.sqrt(own.size)
    assert (programs.pixels(tmp_path / "x.hdr")[0, 0] == 0).all()


# ---- Formats of one's own --------------------------------------------------------------------------------------------


def test_a_format_of_ones_own(plastic, tmp_path):
    @register("raw", summary="float32, row by row", files=("f32",))
    def raw(view, *, gain=1.0):
        return Encoded({"f32": (gain * view.image).astype("<f4").tobytes()}, (f"gain {gain}",))

    try:
        made = publish(plastic, (1, 2, 3), "raw,gain=2.0", tmp_path)
    finally:
        unregister("raw")
    assert np.frombuffer(made.files[0].read_bytes(), "<f4").size == 8 * 8 * 3
    assert made.notes == ("red_paint, raw: gain 2.0",)
    assert "raw" not in formats()


def test_a_format_must_make_what_it_declares():
    @register("liar", summary="declares one file and makes another", files=("a",))
    def liar(view):
        return Encoded({"b": b""})

    try:
        with pytest.raises(InputError, match="liar: declares the files a and makes b"):
            format_of("liar").encode(None)
    finally:
        unregister("liar")


def test_formats_are_divided_by_commas_that_no_option_owns():
    found = formats_of(["latlong-exr,size=64,half=true,ktx2", "sh"])
    assert [(one.name, dict(one.chosen)) for one in found] == [
        ("latlong-exr", {"size": 64, "half": True}),
        ("ktx2", {}),
        ("sh", {}),
    ]


# ---- The command -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_command(plastic, shell, tmp_path):
    there = shutil.copytree(plastic.path, tmp_path / "b.rsibr")
    (tmp_path / "own.py").write_text(
        "from rsibr.publishing.registry import Encoded, register\n"
        "@register('own', summary='ten bytes', files=('ten',))\n"
        "def own(view):\n    return Encoded({'ten': bytes(10)}, ('ten of them',))\n"
    )
    arguments = ("publish", there, "--view", "1,2,3", "--as", f"{tmp_path / 'own.py'}:own")
    try:
        ended = shell(*arguments, "--out", tmp_path / "out", "--json")
        assert ended.json["files"] == [str(tmp_path / "out" / "b.ten")]
        assert "note: b, own: ten of them" in ended.stderr
        shell.refuses(*arguments[:-1], f"{tmp_path / 'own.py'}:Encoded", "--out", tmp_path / "c", says="is no format")
        shell.refuses(*arguments, "--out", tmp_path / "out", says="--out: ")
        assert shell(*arguments, "--out", tmp_path / "out", "--fresh").stdout == f"{tmp_path / 'out' / 'b.ten'}\n"
    finally:
        unregister("own")
    listed = shell("publish", "--formats")
    assert listed.code == 0
    assert all(f"{name}: " in listed.stdout for name in formats())
    shell.refuses("publish", there, "--as", "dds", "--out", tmp_path / "c", says="--view: no view is named")
    shell.refuses("publish", there, "--as", "dds", "--view", "all", "--view", "1,2,3", "--out", tmp_path, says="--view")
    shell.refuses("publish", there, "--as", "ddss", "--view", "1,2,3", "--out", tmp_path, says="--as: unknown format")


def test_a_package_declares_formats_by_an_entry_point(monkeypatch):
    from importlib.metadata import EntryPoint

    from rsibr import registered
    from rsibr.publishing import registry

    loaded = []
    monkeypatch.setattr(EntryPoint, "load", lambda self: loaded.append(self.value))
    points = [EntryPoint("tables", "package.tables", registry.ENTRY_POINTS)]
    monkeypatch.setattr(registered, "entry_points", lambda group: points if group == registry.ENTRY_POINTS else [])
    registry._discover.cache_clear()
    assert "ktx2" in formats()
    assert loaded == ["package.tables"]

    def broken(self):
        raise RuntimeError("no")

    monkeypatch.setattr(EntryPoint, "load", broken)
    registry._discover.cache_clear()
    with pytest.raises(
        InputError, match=r"'tables' of rsibr\.publishing\.formats \(package\.tables\).*RuntimeError: no"
    ):
        formats()
    monkeypatch.undo()
    registry._discover.cache_clear()


def test_a_family_stands_for_its_exact_file():
    found = formats_of(["latlong,size=64,matcap,ktx2"])
    assert [one.name for one in found] == ["latlong-exr", "matcap-exr", "ktx2"]
    assert dict(found[0].chosen) == {"size": 64}
