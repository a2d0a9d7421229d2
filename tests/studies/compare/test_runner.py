"""A whole comparison, small: same views for all, costs of what is read, resume, external maps, report."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import rsibr
from rsibr.errors import InputError
from rsibr.geometry.frame import unit_view
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.registry import registration
from rsibr.store.bake import open_bake
from rsibr.studies.compare.document import CompareDocument, compare_schema
from rsibr.studies.compare.figures import colours_of
from rsibr.studies.compare.page import answers
from rsibr.studies.compare.report import COLUMNS
from rsibr.studies.compare.runner import compare
from tests.validation.report.test_report import Page

ROOT = Path(__file__).parents[3]
GREY = "tests.studies.compare.grey:Grey"


class KilledError(Exception):
    """Stands for a signal that ends the comparison between two measurements."""


def tables(sky, **changes):
    """A matte sphere under four coloured lights, in 12 and 42 views."""
    base = {
        "environment": {"file": str(sky)},
        "material": {"preset": "matte-lambert"},
        "map": {"resolution": 12},
        "sampling": {"samples": 16},
    }
    return {
        "base": base,
        "subdivision": [0, 1],
        "method": ["cabral1999", GREY],
        "settings": [f"{GREY},value=0.25"],
        "judge": {"views": 2, "samples": 64},
        **changes,
    }


@pytest.fixture(scope="session")
def small(tmp_path_factory, asymmetric_environment):
    """Return a finished comparison."""
    return compare([tables(asymmetric_environment)], out=tmp_path_factory.mktemp("compare"))


def labelled(found):
    (scene,) = found.document.scenes
    return {one.label: one for one in scene.systems}


def test_every_system_is_measured_where_it_differs(small):
    """A method that reads maps at each number of views, one that reads none once."""
    assert list(labelled(small)) == ["cabral1999, 12 views", GREY, f"{GREY},value=0.25", "cabral1999, 42 views"]
    assert small.document.systems == ["cabral1999", GREY]
    assert [one.system for one in labelled(small).values()] == ["cabral1999", GREY, GREY, "cabral1999"]
    assert labelled(small)[f"{GREY},value=0.25"].options == {"value": 0.25}


def test_a_method_is_charged_with_what_it_reads(small):
    found = labelled(small)
    bakes = {bake.view_count: bake for bake in map(open_bake, (small.out / "bakes").iterdir())}
    few, many, grey = (found[name].cost for name in ("cabral1999, 12 views", "cabral1999, 42 views", GREY))
    assert grey.disk_bytes == 0
    assert grey.bytes < 100
    for cost, views in ((few, 12), (many, 42)):
        light = bakes[views].manifest.light
        assert cost.disk_bytes == bakes[views].bytes - (light.bytes if light else 0)
        assert cost.bake_seconds + cost.compile_seconds >= 0.999 * bakes[views].seconds
    assert 0 < grey.bake_seconds < few.bake_seconds
    for one in found.values():
        assert one.cost.once_seconds > one.cost.bake_seconds
        assert one.cost.frame_seconds.runs == one.cost.eval_seconds.runs == 2
        assert 0 < one.cost.eval_seconds.median < one.cost.frame_seconds.median


def test_errors_are_those_of_the_maps_and_of_eval(small):
    found = labelled(small)
    assert max(found[f"cabral1999, {views} views"].rel_mse for views in (12, 42)) < found[GREY].rel_mse / 3
    grey = found[GREY]
    assert grey.eval_rel_mse.value == pytest.approx(grey.error.rel_mse.value, rel=0.05)
    assert found[f"{GREY},value=0.25"].error.energy_ratio == pytest.approx(grey.error.energy_ratio / 2, rel=1e-4)


def test_a_finished_comparison_renders_nothing_again(small, asymmetric_environment, monkeypatch):
    from rsibr.validation.reference import ReferenceRenderer

    def refuse(*_arguments, **_options):
        raise AssertionError("rendered again")

    monkeypatch.setattr(ReferenceRenderer, "render", refuse)
    before = small.document
    again = compare([tables(asymmetric_environment)], out=small.out)
    assert again.document.scenes == before.scenes
    assert again.document.classes == before.classes


def test_the_json_is_the_comparison_and_its_schema_documented(small):
    text = (small.out / "compare.json").read_text(encoding="utf-8")
    assert CompareDocument.model_validate_json(text).scenes == small.document.scenes
    assert json.loads(text)["schema"] == 1
    assert (ROOT / "docs" / "compare.schema.json").read_text(encoding="utf-8") == compare_schema()


def test_the_table_has_a_row_for_every_setting(small):
    with (small.out / "compare.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert [row["setting"] for row in rows] == list(labelled(small))
    for row, one in zip(rows, labelled(small).values(), strict=True):
        assert float(row["rel_mse"]) == one.error.rel_mse.value
        assert float(row["once_seconds"]) == one.cost.once_seconds
        assert int(row["bytes"]) == one.cost.bytes


def test_the_page_answers_first_and_shows_every_system(small):
    text = (small.out / "compare.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(text)
    assert text.index("Which system for which material at which cost?") < text.index("<img")
    (record,) = small.document.classes
    sentences = answers(record)
    assert [sentence.partition(":")[0] for sentence in sentences] == [
        "time before the first map",
        "memory on the device",
        "time of a map",
    ]
    assert all(sentence in text for sentence in sentences)
    assert all("cabral1999" in sentence for sentence in sentences)
    assert page.open == []
    assert all(reference.startswith("data:image/") for reference in page.references)
    assert len(page.references) == 1 + 1 + 2 * 3  # first figure, fronts of one class, reference and two systems
    assert all(label in page.text for label in labelled(small))
    drawn = {path.name for path in (small.out / "pictures").iterdir()}
    (scene,) = small.document.scenes
    assert drawn == {
        f"{scene.folder}_{name}.png"
        for name in (
            "reference",
            "noise",
            *(f"{kind}_{one}" for kind in ("map", "error") for one in ("cabral1999", f"{__package__}.grey_Grey")),
        )
    }


def test_options_of_a_config_are_measured_anew_when_they_change(asymmetric_environment, tmp_path):
    """In one folder, whose bake and references are kept."""
    errors = []
    for options in ({}, {"k_d": 9.0}, {}):
        asked = tables(asymmetric_environment, method=["miller1984"], settings=None, subdivision=None)
        asked = {key: value for key, value in asked.items() if value is not None}
        asked["base"] = {**asked["base"], **({"methods": {"miller1984": options}} if options else {})}
        ((one,),) = (scene.systems for scene in compare([asked], out=tmp_path / "one", views=1).document.scenes)
        errors.append(one.error.rel_mse.value)
    assert errors[0] == errors[2]
    assert errors[1] > 10 * abs(errors[0])


def test_systems_have_colours_of_their_own():
    systems = [*rsibr.method_names(), "theirs", "others"]
    colours = colours_of(systems)
    assert len(set(colours.values())) == len(systems)
    assert colours_of(["theirs", "rsibr"])["rsibr"] == colours["rsibr"]


def test_mistakes_are_named_before_anything_is_rendered(tmp_path, asymmetric_environment):
    config = tables(asymmetric_environment)
    for options, says in (
        ({"methods": ["cabral"]}, "unknown method"),
        ({"external": [f"rsibr={tmp_path}"]}, "is the name of a method"),
        ({"external": [f"theirs={tmp_path}"], "views": 3}, "views are those of the external maps"),
        ({"external": [f"theirs={tmp_path}"]}, "holds no EXR file"),
    ):
        with pytest.raises(InputError, match=says):
            compare([config], out=tmp_path / "out", **options)
    with pytest.raises(InputError, match="no config"):
        compare([], out=tmp_path / "out")
    assert not list((tmp_path / "out").glob("bakes/*"))


@pytest.mark.slow
def test_external_maps_of_reconstruct_score_as_the_method_itself(small, asymmetric_environment, tmp_path):
    """Exactly at views along an axis; elsewhere the header's float32 turns the view by its rounding."""
    bakes = {bake.view_count: bake for bake in map(open_bake, (small.out / "bakes").iterdir())}
    for folder, views in (("axes", [(0, 1, 0), (-1, 0, 0)]), ("between", [(1, 2, 3), (-0.3, 0.2, 0.9)])):
        for number, view in enumerate(views):
            (tmp_path / folder).mkdir(exist_ok=True)
            made = rsibr.reconstruct(bakes[12], view, method="cabral1999")
            made.write(tmp_path / folder / f"{number}.exr")
        found = labelled(compare([tables(asymmetric_environment)], out=small.out, external=[f"t={tmp_path / folder}"]))
        ours, theirs = found["cabral1999, 12 views"], found["t"]
        assert theirs.cost is theirs.eval_rel_mse is None
        if folder == "axes":
            assert theirs.error == ours.error
        assert theirs.error.rel_mse.value == pytest.approx(ours.error.rel_mse.value, rel=1e-4)
        assert theirs.error.smape == pytest.approx(ours.error.smape, rel=1e-4)


@pytest.mark.slow
def test_a_frame_in_the_header_turns_all_maps_alike(small, asymmetric_environment, tmp_path):
    bake = next(bake for bake in map(open_bake, (small.out / "bakes").iterdir()) if bake.view_count == 12)
    frame = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # along +X, with +Y to the right and +Z up
    run(MethodSet(bake)["cabral1999"], frame, bake.resolution).write(tmp_path / "turned.exr")
    found = labelled(compare([tables(asymmetric_environment)], out=small.out, external=[f"t={tmp_path}"]))
    assert found["t"].error == found["cabral1999, 12 views"].error


@pytest.mark.slow
def test_all_systems_are_judged_at_the_views_of_external_maps(small, asymmetric_environment, tmp_path):
    bake = next(bake for bake in map(open_bake, (small.out / "bakes").iterdir()) if bake.view_count == 12)
    rsibr.reconstruct(bake, (0, 0, 1), method="blend").write(tmp_path / "a.exr")
    found = compare(
        [tables(asymmetric_environment)], out=tmp_path / "out", methods=["cabral1999"], external=[f"t={tmp_path}"]
    )
    (scene,) = found.document.scenes
    np.testing.assert_allclose(scene.views, [unit_view((0, 0, 1))])
    assert found.document.systems == ["cabral1999", "t"]
    page = (found.out / "compare.html").read_text(encoding="utf-8")
    assert "external maps" in page


@pytest.mark.slow
def test_a_killed_comparison_goes_on(small, asymmetric_environment, tmp_path):
    def kill(state):
        if state.done == 2:
            raise KilledError

    with pytest.raises(KilledError):
        compare([tables(asymmetric_environment)], out=tmp_path, on_progress=kill)
    assert not (tmp_path / "compare.json").exists()
    journal = {path: path.stat().st_mtime_ns for path in (tmp_path / "journal").iterdir()}
    found = compare([tables(asymmetric_environment)], out=tmp_path)
    assert all(path.stat().st_mtime_ns == time for path, time in journal.items())
    for label, one in labelled(found).items():
        assert one.error == labelled(small)[label].error


@pytest.mark.slow
def test_all_methods_on_two_configs_with_one_material(asymmetric_environment, tmp_path):
    """Scenes of one name are told apart; every listed method is measured or refused with a reason."""
    base = tables(asymmetric_environment)["base"] | {"material": {"preset": "glossy-plastic"}}
    fine = base | {"map": {"resolution": 24}}
    judge = {"views": 1, "samples": 64, "keep_bakes": False}
    found = compare([{"base": one, "judge": judge} for one in (base, fine)], out=tmp_path)
    names = [scene.material for scene in found.document.scenes]
    assert names == ["glossy-plastic", "glossy-plastic 2"]
    assert not list((tmp_path / "bakes").iterdir())
    for scene in found.document.scenes:
        assert {one.system for one in scene.systems} | set(scene.refused) == set(rsibr.method_names())
        best = scene.best()
        costs = {one.system: one.cost for one in scene.systems}
        assert costs["cabral1999"].eval_prepare_seconds == 0
        assert costs["cabral1999"].eval_bytes == costs["cabral1999"].bytes
        assert costs["rsibr"].eval_prepare_seconds > 0  # its points are prepared apart from its maps
        assert costs["rsibr"].eval_bytes > costs["rsibr"].bytes > costs["cabral1999"].bytes
        assert best["rsibr"].rel_mse < best["cabral1999"].rel_mse < best["nearest"].rel_mse
    (record,) = found.document.classes
    assert (record.name, record.scenes) == ("glossy-plastic", 2)


@pytest.mark.slow
def test_what_a_bake_cannot_serve_is_refused_with_its_reason(tmp_path):
    """A light without extent, which methods may not see, and lobes that are not kept apart."""
    base = {
        "environment": {"emitter": {"type": "constant"}},
        "material": {"preset": "glossy-plastic"},
        "map": {"resolution": 8},
        "sampling": {"samples": 4},
        "effects": {"lobes": "off"},
    }
    config = {"base": base, "method": ["cabral1999", "rsibr"], "judge": {"views": 1, "samples": 8}}
    found = compare([config], out=tmp_path)
    (scene,) = found.document.scenes
    assert [one.system for one in scene.systems] == ["cabral1999"]
    assert "lobes are not stored separately" in scene.refused["rsibr"]
    assert registration("rsibr").needs.lobes
    assert "Not compared: rsibr" in (tmp_path / "compare.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_black_scene_has_no_error_and_a_page(tmp_path):
    base = {
        "environment": {"emitter": {"type": "constant", "radiance": 0.0}},
        "material": {"preset": "matte-lambert"},
        "map": {"resolution": 8},
        "sampling": {"samples": 4},
    }
    config = {"base": base, "method": ["nearest", "cabral1999"], "judge": {"views": 1, "samples": 8}}
    found = compare([config], out=tmp_path)
    assert all(one.rel_mse == 0 for one in found.document.scenes[0].systems)
    assert (tmp_path / "compare.html").is_file()
