"""`metrics.json` in its documented schema, and a page that holds all it shows."""

from __future__ import annotations

import json
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from rsibr.errors import BakeError
from rsibr.planning.plan import Effect, LobePlan, Plan
from rsibr.validation.report.document import MetricsDocument, metrics_document, metrics_schema
from rsibr.validation.report.page import duration, number, size
from rsibr.validation.report.report import write_report
from rsibr.validation.results import Validation
from tests.validation.results_double import small_validation, with_lobes

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Collects what a page refers to and whether its tags nest."""

    def __init__(self):
        super().__init__()
        self.references: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.references += [value for key, value in attrs if key in {"src", "href", "srcset"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def validation():
    return small_validation()


@pytest.fixture(scope="module")
def written(validation, tmp_path_factory):
    return write_report(validation, tmp_path_factory.mktemp("report") / "made" / "here")


@pytest.fixture(scope="module")
def page(written):
    parsed = Page()
    parsed.feed(written.read_text(encoding="utf-8"))
    return parsed


def test_the_metrics_have_the_shape_of_the_design(written):
    metrics = json.loads((written.parent / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["schema"] == 1
    assert metrics["reference"].keys() >= {"samples", "seconds"}
    assert metrics["views"][0]["view"] == pytest.approx([0, 0.6, 0.8])
    method = metrics["views"][1]["methods"]["cabral1999"]
    assert method["rel_mse"].keys() >= {"value", "ci95"}
    assert method.keys() >= {"smape", "flip", "energy_ratio", "worst_texel", "seconds"}
    assert method["worst_texel"].keys() == {"s", "t", "error"}
    assert metrics["summary"]["nearest"].keys() >= {"rel_mse", "smape", "flip", "energy_ratio", "seconds", "bytes"}
    assert metrics["summary"]["nearest"]["bytes"] == 123456
    assert MetricsDocument.model_validate(metrics).to_json() == (written.parent / "metrics.json").read_text()


def test_the_metrics_say_what_was_measured(validation):
    document = metrics_document(validation)
    error = validation.views[0].methods["nearest"].error
    told = document.views[0].methods["nearest"]
    assert (told.rel_mse.value, told.rel_mse.ci95) == (error.rel_mse.value, error.rel_mse.ci95)
    assert (told.worst_texel.s, told.worst_texel.t) == (error.worst_texel.s, error.worst_texel.t)
    assert document.summary["perfect"].rel_mse.below_noise_floor


def test_nan_never_reaches_the_file(validation):
    broken = replace(validation, bake=replace(validation.bake, seconds=float("nan")))
    with pytest.raises(ValidationError, match="finite"):
        metrics_document(broken)


def test_what_is_undefined_is_null(validation):
    view = validation.views[0]
    black = replace(view.methods["nearest"], error=replace(view.methods["nearest"].error, energy_ratio=None))
    changed = Validation(validation.bake, [replace(view, methods={"nearest": black})], validation.exposures)
    metrics = json.loads(metrics_document(changed).to_json())
    assert metrics["views"][0]["methods"]["nearest"]["energy_ratio"] is None
    assert metrics["summary"]["nearest"]["energy_ratio"] is None


def test_the_documented_schema_is_that_of_the_code():
    documented = Path(__file__).parents[3] / "docs" / "metrics.schema.json"
    assert documented.read_text(encoding="utf-8") == metrics_schema()
    assert set(json.loads(metrics_schema())["required"]) >= {"schema", "bake", "reference", "views", "summary"}


def test_the_page_needs_nothing_but_itself(page):
    assert page.references
    assert all(reference.startswith("data:image/webp;base64,") for reference in page.references)
    assert page.tags.count("script") == 1  # its text stands in the page: a source would be among the references
    assert page.open == []


def test_the_page_shows_every_method_at_every_view(page, validation):
    # A view: its small image in the index, reference, its noise; of each method the map, the relative error, FLIP.
    assert page.tags.count("img") == 2 * (3 + 3 * 3)
    assert page.tags.count("section") == 2
    for name in validation.methods:
        assert page.text.count(name) >= 2 * 2 + 2
    assert "red <paint>" in page.text  # escaped in the source
    assert "below the noise floor" in page.text.replace("\xa0", " ")


def test_the_page_tells_error_and_time_and_what_the_bake_saves(page, validation):
    text = page.text.replace("\xa0", " ")
    for summary in validation.summary.values():
        assert str(summary.rel_mse) in text
        assert duration(summary.path_tracing_seconds).replace("\xa0", " ") in text
        assert ("never" if summary.break_even_views is None else f"{summary.break_even_views} view") in text


def test_the_page_shows_the_plan_and_names_what_was_left_out(validation, tmp_path):
    missed = Effect("diffuse", False, "off", 0.4, 1e-9, "of the light", "forced off <here>", 0, 0, None, 2**20, 0.2)
    kept = Effect("colour", True, None, 0.5, 1e-4, "difference", "the light is coloured", 2.5, 2**21, 0, 0, 0.1)
    lobe = LobePlan("glossy-0.1", True, 42, 0.3, 1e-5, "interpolated")
    plan = Plan((missed, kept), (lobe,), ("diffuse",), False, True, 32, 10.0, 2**22, 0.1, "measured")
    page = Page()
    page.feed(write_report(replace(validation, plan=plan), tmp_path).read_text(encoding="utf-8"))
    assert page.open == []
    text = " ".join(page.text.replace("\xa0", " ").split())
    for part in (
        "Left out though it matters here: diffuse",
        "forced off <here>",
        "2.50 s",
        "1.00 MiB",
        "maps from 42 views",
    ):
        assert part in text
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["plan"]["effects"][0]["name"] == "diffuse"
    assert MetricsDocument.model_validate(metrics).plan == plan


def test_the_page_names_the_worst_lobe_of_each_view(validation, tmp_path):
    parsed = Page()
    parsed.feed(write_report(with_lobes(validation), tmp_path).read_text(encoding="utf-8"))
    first, second = parsed.text.split("View 2")
    assert "Of the lobes of rsibr, clear coat, α 0.015 has the largest error here" in first
    assert "Of the lobes of rsibr, diffuse under a coat has the largest error here" in second
    assert "A path tracer cannot separate lobes" in second
    assert parsed.tags.count("img") == 2 * (3 + 3 * 3) + 2 * 2 * 3  # of each lobe its reference, our part, the error
    assert parsed.open == []
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert {f"view_02_lobe_coat_{kind}.png" for kind in ("reference", "image", "error")} <= names


def test_the_metrics_hold_the_lobes(validation):
    metrics = json.loads(metrics_document(with_lobes(validation)).to_json())
    assert [view["lobes"]["worst"] for view in metrics["views"]] == ["coat", "diffuse"]
    assert metrics["views"][0]["lobes"]["errors"]["coat"]["rel_mse"]["value"] == 2e-3
    assert metrics["lobes"] | {"summary": 0} == {
        "method": "rsibr",
        "samples": 64,
        "buffers": 8,
        "seconds": 3,
        "summary": 0,
    }
    summary = metrics["lobes"]["summary"]["coat"]
    assert summary["rel_mse"]["value"] == pytest.approx(1.5e-3)
    assert (summary["rel_mse_range"], summary["light"], summary["worst_views"]) == ([1e-3, 2e-3], 0.5, 1)
    told = json.loads(metrics_document(validation).to_json())
    assert (told["lobes"], told["views"][0]["lobes"]) == (None, None)


def test_pictures_lie_beside_the_page(written):
    names = {path.name for path in (written.parent / "pictures").iterdir()}
    assert len(names) == 22
    assert {"view_01_reference.png", "view_02_cabral1999.png", "view_02_cabral1999_error.png"} <= names


def test_a_second_report_replaces_the_first_and_touches_nothing_else(validation, tmp_path):
    write_report(validation, tmp_path)
    (tmp_path / "pictures" / "mine.png").write_bytes(b"mine")
    write_report(Validation(validation.bake, validation.views[:1], validation.exposures), tmp_path)
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert len(names) == 12
    assert "mine.png" in names
    assert not [path for path in tmp_path.rglob("*") if "tmp" in path.name]


def test_a_directory_that_cannot_be_made_is_an_error_of_the_user(validation, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(BakeError, match="file"):
        write_report(validation, tmp_path / "file")


def test_a_black_scene_is_reported_too(tmp_path):
    black = small_validation(factors={"nearest": 1.0})
    view = black.views[0]
    reference = replace(view.reference, buffers=np.zeros_like(view.reference.buffers))
    page = write_report(
        Validation(black.bake, [replace(view, reference=reference)], black.exposures), tmp_path
    ).read_text(encoding="utf-8")
    assert "<h1>" in page


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (None, "–"),
        (0.01234, "0.0123"),
        (2.346e-5, "2.35 × 10⁻⁵"),
        (240.4, "240"),
        (12345.0, "12300"),
        (9.999e-4, "0.00100"),
        (0.09996, "0.100"),
        (-0.5, "-0.500"),
        (1.5e9, "1.50 × 10⁹"),
    ],
)
def test_numbers_read_well(value, text):
    assert number(value).replace("\xa0", " ") == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0025, "2.50 ms"), (12.34, "12.3 s"), (200, "3 min 20 s"), (7500, "2 h 05 min"), (0, "0 ms"), (59.96, "60.0 s")],
)
def test_times_read_well(seconds, text):
    assert duration(seconds).replace("\xa0", " ") == text


def test_sizes_read_well():
    assert [size(n).replace("\xa0", " ") for n in (0, 1023, 5_600_000)] == ["0 B", "1020 B", "5.34 MiB"]
