"""A whole study, small: what it says is so, it goes on where it was killed, and it shares what it can."""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from itertools import count
from pathlib import Path

import pytest

import rsibr
from rsibr.errors import InputError
from rsibr.store.bake import open_bake
from rsibr.studies.document import StudyDocument, study_schema
from rsibr.studies.page import estimate
from rsibr.studies.report import COLUMNS
from rsibr.studies.runner import study
from rsibr.validation.report.page import duration
from tests.studies.conftest import tables
from tests.validation.report.test_report import Page

ROOT = Path(__file__).parents[2]


class KilledError(Exception):
    """Stands for a signal that ends the study between two steps."""


def errors(found):
    """Everything of a study that no clock decides."""
    return {
        (scene.name, point.label): (point.error, point.noise, point.bias, point.lobes)
        for scene in found.document.scenes
        for point in scene.points
    } | {
        (scene.name, picture.samples, picture.pass_samples): picture.error
        for scene in found.document.scenes
        for picture in (*scene.path_tracing, *scene.progressive)
    }


def test_every_point_of_the_plan_is_there_with_its_error_and_its_costs(small):
    (scene,) = small.document.scenes
    assert [point.label for point in scene.points] == [
        *(f"{m}, 12 views, 16², {n} samples" for n in (4, 16, 64) for m in ("cabral1999", "rsibr")),
    ][:4] + ["cabral1999, mesh-4x12, float16, 12 views, 16², 16 samples"] + [
        f"{m}, 12 views, 16², 64 samples" for m in ("cabral1999", "rsibr")
    ]
    for point in scene.points:
        assert 0 < point.error.rel_mse.value < 1
        assert point.frame_seconds.runs == 2 * 3
        assert 0 < point.frame_seconds.low <= point.frame_seconds.median <= point.frame_seconds.high
        bake = point.bake
        assert bake.views_seconds.median > 0
        assert bake.setup_seconds > bake.compile_seconds >= 0
        assert bake.seconds.median == pytest.approx(bake.views_seconds.median + bake.setup_seconds)
        assert point.prepare_seconds > 0
        assert point.once_seconds == pytest.approx(bake.seconds.median + point.prepare_seconds + point.compile_seconds)
        assert 0 < point.eval_rel_mse.value < 1
        assert 0 < point.eval_seconds.median < point.frame_seconds.median
        assert point.bias.value == pytest.approx(point.rel_mse - point.noise)
        assert (point.lobes is not None) == (point.method == "rsibr")
    assert [picture.samples for picture in scene.path_tracing] == [16, 64, 256]
    assert scene.reference.noise_floor < 1e-2


def test_noise_falls_with_the_samples_and_bias_stays(small):
    ((_, analysis),) = small.scenes
    curves = {curve.label: curve for curve in analysis.convergence}
    for method in ("cabral1999", "rsibr"):
        noise = [p.noise for p in small.points(method=method, warp="texel")]
        assert noise[0] > 2.5 * noise[1] > 6 * noise[2]
    paper = curves["cabral1999, 12 views, 16²"]
    biases = [p.bias.value for p in small.points(method="cabral1999", warp="texel")]
    assert max(biases) < 1.2 * min(biases)
    assert paper.bias == pytest.approx(biases[-1], rel=0.2)
    assert paper.noise == pytest.approx(paper.predicted_noise, rel=0.6)


def test_a_bake_counts_what_it_found_made(small):
    """The parts that all bakes of a scene share are made once, and are in the time of each."""
    bakes = [open_bake(path) for path in (small.out / "bakes").iterdir()]
    assert len(bakes) == 3
    records = {point.bake.samples: point.bake for point in small.points()}
    for bake in bakes:
        record = records[bake.manifest.samples]
        assert record.seconds.median >= 0.999 * bake.seconds
        assert bake.seconds > bake.manifest.total_seconds
    least = min(record.setup_seconds for record in records.values())
    assert least > 0.3 * max(record.setup_seconds for record in records.values())


def test_variants_of_one_kernel_are_charged_with_one_compilation(small):
    for method in ("cabral1999", "rsibr"):
        assert len({p.compile_seconds for p in small.points(method=method, warp="texel")}) <= 3
        first, *others = (p.compile_seconds for p in small.points(method=method, warp="texel"))
        assert all(other >= first for other in others)


def test_every_step_tells_its_forecast_and_its_time(small):
    document = small.document
    names = [step.step.rpartition(": ")[2] for step in document.steps]
    assert names[0] == "preparation"
    assert names[-1] == "page"
    assert names.count("bake of 12 views, 16², 4 samples") == 1
    assert names.count("rsibr of 12 views") == 3
    assert sum(step.expected_seconds for step in document.steps) == pytest.approx(document.expected_seconds)
    assert sum(step.seconds for step in document.steps) == pytest.approx(document.seconds, rel=0.05)
    assert all(step.expected_seconds > 0 for step in document.steps)


def test_points_are_chosen_by_what_they_are(small):
    assert {p.method for p in small.points(samples=16)} == {"cabral1999", "rsibr"}
    assert [p.warp for p in small.points(precision="float16")] == ["mesh-4x12"]
    assert small.points(samples=5) == []


def test_a_finished_study_has_nothing_left_to_do(small, asymmetric_environment):
    seen = []
    before = {path: path.read_bytes() for path in (small.out / "journal").iterdir()}
    again = study(tables(asymmetric_environment), out=small.out, on_progress=seen.append)
    assert [(state.done, state.total) for state in seen] == [(0, 0)]
    assert {path: path.read_bytes() for path in (small.out / "journal").iterdir()} == before
    assert again.document.scenes == small.document.scenes


@pytest.mark.slow
def test_killed_between_any_two_steps_it_goes_on_and_ends_as_if_never_killed(small, asymmetric_environment, tmp_path):
    settings = tables(asymmetric_environment)
    runs = []
    for at in count():
        progress = []

        def stop(state, progress=progress):
            progress.append(state.step)
            if len(progress) == 7:
                raise KilledError

        try:
            found = study(settings, out=tmp_path, on_progress=stop)
            break
        except KilledError:
            runs.append(tuple(progress[:6]))
        assert at < 20
    assert len(runs) == len(set(runs)) > 1  # what is done is not done again
    assert errors(found) == errors(small)


@pytest.mark.slow
def test_killed_by_the_system_it_goes_on_and_ends_as_if_never_killed(small, asymmetric_environment, tmp_path):
    """SIGKILL at moments that differ in how far the study has come."""
    (tmp_path / "tables.json").write_text(json.dumps(tables(asymmetric_environment)))
    code = "import json, sys, rsibr; rsibr.study(json.load(open(sys.argv[1])), out=sys.argv[2])"
    arguments = [sys.executable, "-c", code, str(tmp_path / "tables.json"), str(tmp_path / "out")]
    for results in (1, 3, 6):
        with subprocess.Popen(arguments, cwd=ROOT, stdout=subprocess.DEVNULL) as victim:
            deadline = time.monotonic() + 120
            while len(list((tmp_path / "out").glob("journal/*.json"))) < results and time.monotonic() < deadline:
                assert victim.poll() is None
                time.sleep(0.01)
            os.kill(victim.pid, signal.SIGKILL)
    found = study(tables(asymmetric_environment), out=tmp_path / "out")
    assert errors(found) == errors(small)


@pytest.mark.slow
def test_what_was_altered_on_disk_is_made_anew(small, asymmetric_environment, tmp_path):
    out = shutil.copytree(small.out, tmp_path / "study")
    reference = next((out / "references").glob("reference-*.npz"))
    whole = reference.read_bytes()
    reference.write_bytes(whole[:-100])
    next(out.glob("bakes/*/maps/view_0000.exr")).write_bytes(b"no map")
    for path in (out / "journal").glob("point-*.json"):
        path.unlink()
    assert errors(study(tables(asymmetric_environment), out=out)) == errors(small)
    assert reference.read_bytes() == whole


@pytest.mark.slow
def test_a_wider_sweep_keeps_what_was_measured(small, asymmetric_environment, tmp_path):
    out = shutil.copytree(small.out, tmp_path / "study")
    settings = tables(asymmetric_environment)
    settings["sweep"].append({"samples": [32], "method": ["nearest"]})
    seen = []
    wider = study(settings, out=out, on_progress=seen.append)
    names = [state.step.rpartition(": ")[2] for state in seen]
    assert names == ["bake of 12 views, 16², 32 samples", "nearest of 12 views", "done"]
    assert wider.points()[:-1] == small.points()


def test_progress_tells_the_whole_before_the_first_step(asymmetric_environment, tmp_path):
    seen = []

    def stop(state):
        seen.append(state)
        raise KilledError

    with pytest.raises(KilledError):
        study(tables(asymmetric_environment), out=tmp_path, on_progress=stop)
    assert 0 < seen[0].done < seen[0].total < 600  # the preparation is done
    assert "glossy-plastic under asymmetric: reference 1" in seen[0].step


@pytest.mark.slow
def test_a_black_scene_is_studied_too(tmp_path):
    black = {
        "environment": {"emitter": {"type": "constant", "radiance": 0.0}},
        "material": {"preset": "matte-lambert"},
        "map": {"resolution": 8},
        "sampling": {"samples": 4},
    }
    settings = {"base": black, "method": ["cabral1999"], "sweep": [{}], "judge": {"views": 1, "samples": 8}}
    found = study(settings, out=tmp_path)
    assert found.points()[0].rel_mse == 0
    (row,) = found.document.analyses[0].rivals
    assert row.path_tracing_seconds is row.break_even_views is None
    assert (tmp_path / "study.html").is_file()


def test_the_documented_schema_is_that_of_the_code():
    documented = ROOT / "docs" / "study.schema.json"
    assert documented.read_text(encoding="utf-8") == study_schema()
    assert set(json.loads(study_schema())["required"]) >= {"schema", "judge", "scenes", "analyses", "doubling"}


def test_the_json_is_the_study(small):
    text = (small.out / "study.json").read_text(encoding="utf-8")
    read = StudyDocument.model_validate_json(text)
    assert read.scenes == small.document.scenes
    assert read.to_json() == text
    assert json.loads(text)["schema"] == 1


def test_the_table_has_a_row_for_every_point(small):
    with (small.out / "study.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    points = {point.label: point for point in small.document.scenes[0].points}
    assert len(rows) == 3 + 3 + len(points)
    (row,) = (row for row in rows if row["precision"] == "float16")
    (point,) = small.points(precision="float16")
    assert float(row["rel_mse"]) == point.rel_mse
    assert float(row["bake_seconds"]) == point.bake.seconds.median
    assert float(row["views_seconds"]) == point.bake.views_seconds.median
    assert float(row["prepare_seconds"]) == point.prepare_seconds
    assert float(row["compile_seconds"]) == point.compile_seconds
    assert float(row["once_seconds"]) == point.once_seconds
    assert float(row["job_seconds"]) == point.job_seconds(small.document.judge.frames)
    assert float(row["eval_rel_mse"]) == point.eval_rel_mse.value
    assert float(row["eval_seconds"]) == point.eval_seconds.median
    assert int(row["bytes"]) == point.bytes
    assert {row["method"] for row in rows} == {"path tracing", "path tracing, passes of 16", "cabral1999", "rsibr"}


def test_the_page_holds_all_it_shows(small):
    page = Page()
    page.feed((small.out / "study.html").read_text(encoding="utf-8"))
    assert page.open == []
    assert "script" not in page.tags
    assert page.references
    assert all(reference.startswith("data:image/svg+xml;base64,") for reference in page.references)
    assert page.tags.count("img") == 1 + 3
    for point in small.document.scenes[0].points:
        assert page.text.count(point.label) >= 2
    assert "What do I buy with twice the time?" in page.text
    for point in small.points():
        for shown in (estimate(point.eval_rel_mse), duration(point.prepare_seconds), duration(point.compile_seconds)):
            assert shown in page.text
    written = StudyDocument.model_validate_json((small.out / "study.json").read_text(encoding="utf-8"))
    assert f"took {duration(written.seconds)}; the forecast was {duration(written.expected_seconds)}" in page.text
    assert "nan" not in page.text.lower().split()


def test_the_python_interface_is_that_of_the_module(small):
    assert callable(rsibr.study)
    with pytest.raises(InputError, match="there is no such config"):
        rsibr.study("nowhere.toml", out=small.out)
    assert math.isfinite(small.document.seconds)
