"""A study of errors alone, by class of material: a tiny zoo."""

from __future__ import annotations

import csv
import json

import pytest

from rsibr.studies.document import StudyDocument
from rsibr.studies.runner import study
from rsibr.studies.scene import StudyScene
from tests.studies.conftest import zoo_tables
from tests.studies.test_runner import KilledError
from tests.validation.report.test_report import Page

METHODS = ("cabral1999", "rsibr", "rsibr-fine")


def test_errors_are_measured_and_nothing_beside_them(zoo):
    assert [(scene.material, scene.material_class) for scene in zoo.document.scenes] == [
        ("glossy-plastic", "plastic"),
        ("dull copper", "metal"),
    ]
    for scene in zoo.document.scenes:
        assert scene.path_tracing == scene.progressive == []
        assert [point.method for point in scene.points] == list(METHODS)
        assert sum(scene.reference.zones.values()) == pytest.approx(1)
        for point in scene.points:
            assert -0.01 < point.rel_mse < 1  # noise of the truth taken out
            assert point.noise is point.bias is point.lobes is point.eval_rel_mse is point.eval_seconds is None
            assert point.frame_seconds.runs == 2 * 3
    assert zoo.scenes == zoo.document.analyses == zoo.document.doubling == []
    steps = [step.step for step in zoo.document.steps]
    assert not [step for step in steps if "path tracing" in step or "lobes" in step]


def test_every_class_has_a_row_for_each_method(zoo):
    rows = zoo.document.classes
    assert {(row.method, row.material_class, row.pairs) for row in rows} == {
        (method, *one) for method in METHODS[1:] for one in (("plastic", 1), ("metal", 1), (None, 2))
    }
    by_name = {(scene.material, point.method): point.rel_mse for scene in zoo.document.scenes for point in scene.points}
    for row in rows:
        worst = row.worst
        assert worst.rel_mse == by_name[worst.material, row.method]
        assert worst.baseline_rel_mse == by_name[worst.material, "cabral1999"]
        assert 0 <= worst.place.view < 2


def test_bakes_go_once_they_are_measured_and_references_stay(zoo):
    assert list((zoo.out / "bakes").iterdir()) == []
    assert len(list((zoo.out / "references").glob("reference-*.npz"))) == 2 * 2


def test_what_it_writes_holds_the_classes(zoo):
    text = (zoo.out / "study.json").read_text(encoding="utf-8")
    assert StudyDocument.model_validate_json(text).classes == zoo.document.classes
    assert json.loads(text)["classes"][0]["gain"].keys() == {"mean", "least", "untold"}
    with (zoo.out / "study.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["class"] for row in rows] == 3 * ["plastic"] + 3 * ["metal"]
    assert {row["noise"] for row in rows} == {row["eval_rel_mse"] for row in rows} == {""}
    assert float(rows[0]["worst_s"]) == zoo.document.scenes[0].points[0].error.worst_place.s
    page = Page()
    page.feed((zoo.out / "study.html").read_text(encoding="utf-8"))
    assert page.open == []
    assert page.tags.count("img") == 0
    assert "rsibr-fine by class of material" in page.text
    assert "dull copper under asymmetric" in page.text
    assert "twice the time" not in page.text


@pytest.mark.slow
def test_killed_at_any_step_it_goes_on_and_ends_as_if_never_killed(zoo, asymmetric_environment, tmp_path):
    settings = zoo_tables(asymmetric_environment)

    def killed_after(steps):
        seen = []

        def stop(state):
            seen.append(state.step)
            if len(seen) > steps:
                raise KilledError

        return stop

    for steps in (2, 4, 3):
        with pytest.raises(KilledError):
            study(settings, out=tmp_path, on_progress=killed_after(steps))
    again = []
    found = study(settings, out=tmp_path, on_progress=lambda state: again.append(state.step))
    assert len(again) <= 2 * (2 + 1 + 3) + 1 - (2 + 4 + 3) + 1  # "done" is one more, and a bake may be opened again
    assert found.document.classes == zoo.document.classes
    assert [[point.error for point in scene.points] for scene in found.document.scenes] == [
        [point.error for point in scene.points] for scene in zoo.document.scenes
    ]


def test_only_the_scene_at_work_is_prepared(zoo, asymmetric_environment, monkeypatch):
    """All but the first are released before the first step, each when it is done: their BSDFs slow every kernel."""
    released, real = [], StudyScene.release

    def release(scene):
        released.append(scene.material_name)
        real(scene)

    monkeypatch.setattr(StudyScene, "release", release)
    again = study(zoo_tables(asymmetric_environment), out=zoo.out)
    assert again.document.classes == zoo.document.classes
    assert released == ["dull copper", "glossy-plastic", "dull copper"]
