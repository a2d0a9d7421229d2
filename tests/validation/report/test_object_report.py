"""`object.json` in its documented schema, and the page of an object's validation."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rsibr.planning.plan import Effect
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.effects.object_plan import ObjectPlan
from rsibr.shading.pictures.picture import NormalCounts, Picture
from rsibr.validation.flip import exposures_for
from rsibr.validation.objects.causes import Truths, causes_of
from rsibr.validation.objects.object_error import object_error
from rsibr.validation.objects.results import MethodPicture, ObjectValidation
from rsibr.validation.objects.zones import ZONES
from rsibr.validation.report.object_document import ObjectDocument, object_document, object_schema
from rsibr.validation.report.object_report import write_object_report
from rsibr.validation.results import BakeSummary
from tests.validation.doubles import noisy_reference, smooth_map
from tests.validation.report.test_report import Page


@pytest.fixture(scope="module")
def validation():
    """Two methods, one 5 % and one 20 % too bright; the shadows that both miss take 20 %."""
    rng, exposures = np.random.default_rng(3), exposures_for(1.0)
    truth = smooth_map()
    names = ("open", "one_map", "shadowed", "full", "all_over")
    truths = Truths(
        **{
            n: noisy_reference(truth * np.float32(f), 0.01, rng)
            for n, f in zip(names, (1, 1.1, 0.8, 0.9, 1), strict=True)
        },
        bent=np.zeros(truth.shape[:2], np.float32),
    )
    column = np.broadcast_to(np.arange(32), (32, 32))
    zones = dict(zip(ZONES, (column < 4, (column >= 4) & (column < 20), column >= 20), strict=True))
    alpha, methods = truths.open.coverage, {}
    for name, factor in {"near <it>": 1.05, "far": 1.2}.items():
        image = truth * np.float32(factor)
        picture = Picture(image * alpha[..., None], alpha, alpha, image, NormalCounts(900, 1, 2, 3, 4), 0.01, 0.5)
        errors = [object_error(image, one, zones, exposures, name) for one in (truths.open, truths.full, truths.full)]
        methods[name] = MethodPicture(picture, picture, *errors, compile_seconds=0.25, path_tracing_seconds=5.0)
    bake = BakeSummary("paint.rsibr", "red <paint>", "city", 12, 32, 256, 10.0, 123456)
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=32, height=32)
    parts = ("car <body>", camera, 16, "pixel", "off", {"*": bake}, zones, truths, causes_of(truths), methods)
    missed = Effect(
        "self_occlusion", False, "off", 0.4, 1e-3, "of the sky", "forced off <here>", error_if_left_out=0.07
    )
    return ObjectValidation(*parts, exposures, ObjectPlan((missed,)), ("the emitters of the file are ignored",))


@pytest.fixture(scope="module")
def written(validation, tmp_path_factory):
    return write_object_report(validation, tmp_path_factory.mktemp("report") / "made" / "here")


@pytest.fixture(scope="module")
def page(written):
    parsed = Page()
    parsed.feed(written.read_text(encoding="utf-8"))
    return parsed


def test_the_documented_schema_is_that_of_the_code():
    documented = Path(__file__).parents[3] / "docs" / "object.schema.json"
    assert documented.read_text(encoding="utf-8") == object_schema()


def test_the_file_says_what_was_measured(written, validation):
    text = (written.parent / "object.json").read_text(encoding="utf-8")
    assert ObjectDocument.model_validate_json(text).to_json() == text
    told = json.loads(text)
    assert told["schema"] == 1
    for name, made in validation.methods.items():
        for against in ("open", "full"):
            error = getattr(made, against)
            one = told["methods"][name][against]
            assert one["whole"]["rel_mse"]["value"] == error.whole.rel_mse.value
            assert one["whole"]["energy_ratio"]["ci95"] == list(error.whole.energy_ratio.ci95)
            assert set(one["zones"]) == set(ZONES)
    assert [cause["name"] for cause in told["causes"]] == [cause.name for cause in validation.causes]
    assert told["normals"] == {"hits": 900, "replaced": 1, "flipped": 2, "bent": 3, "back": 4}
    assert told["methods"]["far"]["hit_seconds"] == pytest.approx(0.01 / 900)


def test_the_page_needs_nothing_but_itself_and_shows_all(page, validation):
    assert all(reference.startswith("data:image/webp;base64,") for reference in page.references)
    assert page.tags.count("script") == 1  # its text stands in the page: a source would be among the references
    assert page.open == []
    # Truths and zones; for each of two truths: it and its noise, and of each method picture, error and FLIP
    assert page.tags.count("img") == 4 + 2 * (2 + 2 * 3)
    text = page.text.replace("\xa0", " ")
    for words in ("car <body>", "red <paint>", "near <it>", "the emitters of the file are ignored", "visibility"):
        assert words in text
    for cause in validation.causes:
        assert str(cause.rel_mse) in text
    assert validation.best == "near <it>"
    assert "forced off <here>" in text
    assert "it matters here: self_occlusion" in text


def test_files_of_an_earlier_report_are_removed_and_others_kept(validation, tmp_path):
    write_object_report(validation, tmp_path)
    keep = tmp_path / "pictures" / "mine.png"
    keep.write_bytes(b"mine")
    fewer = replace(validation, methods={"far": validation.methods["far"]})
    write_object_report(fewer, tmp_path)
    names = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert "mine.png" in names
    assert {"object_far_open.png", "object_far_full_error.png"} <= names
    assert not any("near" in name for name in names)


def test_a_missing_energy_ratio_is_null_and_a_dash(validation, tmp_path):
    far = validation.methods["far"]
    black = replace(far, open=replace(far.open, whole=replace(far.open.whole, energy_ratio=None)))
    changed = replace(validation, methods={"far": black})
    assert object_document(changed).methods["far"].open.whole.energy_ratio is None
    assert "–" in write_object_report(changed, tmp_path).read_text(encoding="utf-8")
