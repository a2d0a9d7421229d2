"""What a study cannot have is refused before anything is rendered; what other code measured is measured anew."""

from __future__ import annotations

import pytest

from rsibr.errors import InputError, MachineError, RsibrError
from rsibr.methods.registry import method_digest
from rsibr.studies.agenda import agenda_of
from rsibr.studies.config import parse_study
from rsibr.studies.runner import _benches, study
from tests.studies.conftest import tables
from tests.studies.test_config import BASE


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"sweep": [{"samples": [4], "resolution": [4096], "subdivision": [5]}]}, "do not fit into one device array"),
        ({"judge": {"resolution": 4096, "views": 1000}}, "references of 1000 views of 4096² take at least"),
        ({"base": {**BASE, "effects": {"lobes": "off"}}}, "needs effects.lobes"),
        ({"scenes": {"environment": ["nowhere.exr"]}}, "there is no such environment map"),
        ({"scenes": {"material": ["glossy-plastic", "nothing"]}}, "unknown preset"),
    ],
)
def test_what_a_study_cannot_have_is_refused_before_anything_is_rendered(tmp_path, monkeypatch, changed, says):
    for rendered in ("rsibr.studies.forecast.measure_rates", "rsibr.studies.bench.bake"):
        monkeypatch.setattr(rendered, lambda *_, **__: pytest.fail("rendered"))
    plain = {"base": BASE, "method": ["rsibr"], "sweep": [{"samples": [4]}]}
    with pytest.raises(RsibrError, match=says):
        study({**plain, **changed}, out=tmp_path / "out")


@pytest.mark.parametrize("name", ["bakes", "references", "journal"])
def test_a_file_in_the_place_of_a_folder_is_refused_at_once(tmp_path, name):
    (tmp_path / name).write_text("")
    with pytest.raises(RsibrError, match=name):
        study({"base": BASE, "sweep": [{"samples": [4]}]}, out=tmp_path)


def test_a_folder_in_the_place_of_the_page_is_refused_at_once(tmp_path):
    (tmp_path / "study.html").mkdir()
    with pytest.raises(InputError, match="is a folder, where the study writes a file"):
        study({"base": BASE, "sweep": [{"samples": [4]}]}, out=tmp_path)


def test_the_disk_must_hold_all_bakes(tmp_path, monkeypatch):
    full = type("Usage", (), {"free": 1000})
    monkeypatch.setattr("rsibr.machine.shutil.disk_usage", lambda _: full)
    with pytest.raises(MachineError, match="the bakes take at least"):
        study({"base": BASE, "sweep": [{"samples": [4]}]}, out=tmp_path)


@pytest.mark.parametrize("other", ["method", "judging", "baking"])
def test_points_of_other_code_are_not_reused(small, asymmetric_environment, monkeypatch, other):
    """Of one method where that has changed; of all where what bakes or judges has."""
    settings = parse_study(tables(asymmetric_environment))
    agenda = agenda_of(settings)
    points = [(size, variant) for size, variants in agenda.items() for variant in variants]

    def known():
        (bench,) = _benches(settings, agenda, small.out)
        return {variant.method for size, variant in points if bench.known_point(size, variant) is not None}

    assert known() == {"cabral1999", "rsibr"}
    if other == "method":
        changed = lambda name: "changed" if name == "rsibr" else method_digest(name)  # noqa: E731
        monkeypatch.setattr("rsibr.studies.bench.method_digest", changed)
        assert known() == {"cabral1999"}
    else:
        name = {"judging": "source_digest", "baking": "baking_code"}[other]
        monkeypatch.setattr(f"rsibr.studies.scene.{name}", lambda *_: "changed")
        assert known() == set()


def test_the_digest_of_a_method_is_that_of_its_code_and_its_fixed_options():
    assert len({method_digest(name) for name in ("cabral1999", "cabral1999-mesh")}) == 2
    assert method_digest("rsibr") == method_digest("rsibr")
