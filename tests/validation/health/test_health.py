"""A sound bake has no findings; each illness is found in its view and at its place, pictured and written down."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from rsibr.baking.baker import bake
from rsibr.errors import BakeError, CheckFailed
from rsibr.geometry.viewpoints import icosphere
from rsibr.scene.config import parse_config
from rsibr.store.bake import Bake, BakeWriter, open_bake
from rsibr.store.manifest import Manifest
from rsibr.store.map_file import MapFile
from rsibr.validation.health.check import check
from rsibr.validation.health.energy import Drift, MapMeans, _left_out, drifting_views, mean_of_map, zonal_moments
from rsibr.validation.health.health import KINDS, MARKS, Health
from rsibr.validation.health.health_document import HealthModel
from rsibr.validation.report.document import MetricsDocument
from rsibr.validation.singularity import near_singularity
from rsibr.validation.validation import validate
from tests.scene.maps import asymmetric, gradient, write_exr
from tests.validation.report.test_report import Page

N = 32
SICK = 7


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Bake:
    """Rough metal under four coloured lights, twelve views."""
    folder = tmp_path_factory.mktemp("sound")
    write_exr(folder / "sky.exr", asymmetric())
    data = {
        "environment": {"file": "sky.exr"},
        "material": {"bsdf": {"type": "roughconductor", "alpha": 0.2}},
        "map": {"resolution": N},
        "sampling": {"samples": 256},
    }
    return bake(parse_config(data, folder), out=folder / "sound.rsibr")


def tampered(original: Bake, out: Path, changes: dict[int, MapFile]) -> Bake:
    """Return the same bake with some maps replaced, stored as a baker would."""
    manifest = original.manifest
    fresh = manifest.with_views(*(state.pending() for state in manifest.views))
    with BakeWriter.open(out, Manifest.model_validate(fresh.model_dump())) as writer:
        writer.commit_light(original.light)
        for index in range(original.view_count):
            writer.commit(index, changes.get(index, original.map(index)), 0.25)
    return open_bake(out)


def with_value(map_file: MapFile, part: str, where: tuple, value: float) -> MapFile:
    images = {"variance": map_file.variance, "coverage": map_file.coverage, **map_file.layers}
    image = images[part].copy()
    image[where] = value
    if part in map_file.layers:
        return replace(map_file, layers={**map_file.layers, part: image})
    return replace(map_file, **{part: image})


def found(health: Health) -> dict[str, list[tuple[int, int, int]]]:
    findings = health.findings.items()
    return {kind: [(p.view, p.row, p.column) for p in f.places] for kind, f in findings if f.texels}


def test_a_sound_bake_has_no_findings(sound):
    """False alarms: fireflies none with 8 blocks, drift 1e-3."""
    health = check(sound)
    assert found(health) == {}
    assert health.trusted
    assert health.warnings == 0
    assert (health.drifts, health.above_light, health.energy_note) == ((), (), "")
    assert (health.views, health.texels) == (12, 12 * int((sound.map(0).coverage > 0).sum()))
    assert 0.001 < health.relative_error < 0.1
    assert list(health.pictures) != []  # the noisiest view


@pytest.mark.parametrize(
    ("kind", "part", "where", "value"),
    [
        ("non_finite", "radiance", (10, 21, 1), np.nan),
        ("non_finite", "variance", (10, 21, 2), np.inf),
        ("holes", "coverage", (10, 21), 0.0),
        ("half_overflow", "radiance", (10, 21, 0), 1e5),
    ],
)
def test_each_illness_is_found_at_its_place(sound, tmp_path, kind, part, where, value):
    sick = tampered(sound, tmp_path / "sick.rsibr", {SICK: with_value(sound.map(SICK), part, where, value)})
    health = check(sick)
    assert found(health) == {kind: [(SICK, 10, 21)]}
    assert health.trusted == (kind == "half_overflow")
    assert getattr(sick.manifest.views[SICK].health, kind) == 1
    assert sum(getattr(state.health, kind) for state in sick.manifest.views) == 1
    assert list(health.pictures) == [SICK]
    assert (health.pictures[SICK][..., :3] == MARKS[kind]).all(axis=-1).sum() == 16  # a 5 × 5 outline


def test_a_firefly_is_a_warning_at_its_place(sound, tmp_path):
    bright = with_value(sound.map(3), "radiance", (16, 9), 50.0)
    sick = tampered(sound, tmp_path / "sick.rsibr", {3: with_value(bright, "variance", (16, 9), 48.0**2)})
    health = check(sick)
    assert found(health) == {"fireflies": [(3, 16, 9)]}
    assert health.findings["fireflies"].places[0].value == pytest.approx(48 / 50, rel=1e-3)
    assert health.trusted
    assert health.warnings == 1


def test_a_place_is_told_by_coordinates_and_directions(sound, tmp_path):
    sick = tampered(sound, tmp_path / "s.rsibr", {SICK: with_value(sound.map(SICK), "radiance", (10, 21), np.nan)})
    place = check(sick).findings["non_finite"].places[0]
    assert (place.s, place.t) == ((21 + 0.5) / N, 1 - (10 + 0.5) / N)
    frame, v = sound.map(SICK).frame, sound.directions[SICK]
    local = frame.T @ np.array(place.normal)
    assert local[:2] == pytest.approx([2 * place.s - 1, 2 * place.t - 1], abs=1e-5)
    assert np.cross(np.array(place.reflection) + v, place.normal) == pytest.approx(0, abs=1e-5)
    assert np.linalg.norm(place.reflection) == pytest.approx(1, abs=1e-5)


def test_a_view_that_is_a_third_too_bright_drifts_and_no_other(sound, tmp_path):
    image = sound.map(SICK).layers["radiance"] * np.float32(1.33)
    sick = tampered(sound, tmp_path / "s.rsibr", {SICK: replace(sound.map(SICK), layers={"radiance": image})})
    health = check(sick)
    assert {drift.view for drift in health.drifts} == {SICK}
    assert all(drift.ratio == pytest.approx(1.33, abs=0.1) for drift in health.drifts)
    assert health.trusted
    assert health.warnings == 1


def test_more_light_than_the_environment_has_is_seen(sound, tmp_path):
    image = sound.map(2).layers["radiance"] * 100
    health = check(tampered(sound, tmp_path / "s.rsibr", {2: replace(sound.map(2), layers={"radiance": image})}))
    assert health.above_light == (2,)


def test_without_its_environment_the_energy_is_not_judged_and_that_is_said(sound, tmp_path):
    data = {**sound.manifest.model_dump(), "views": [s.pending().model_dump() for s in sound.manifest.views]}
    for file, said in (("gone.exr", "gone.exr"), ("other.exr", "changed")):
        config = json.loads(json.dumps(sound.config))
        config["environment"]["file"] = str(tmp_path / file)
        write_exr(tmp_path / "other.exr", asymmetric() * 2)
        manifest = Manifest.planned(
            **{key: data[key] for key in ("identity", "packages", "variant", "resolution", "directions", "triangles")},
            config=config,
            environment=sound.manifest.environment,
            material=sound.manifest.material,
        )
        with BakeWriter.open(tmp_path / "b.rsibr", manifest, fresh=True) as writer:
            for index in writer.pending:
                writer.commit(index, sound.map(index), 0.25)
        health = check(tmp_path / "b.rsibr")
        assert said in health.energy_note
        assert health.trusted


def test_the_zonal_moments_are_those_of_the_closed_form(tmp_path, gradient_axis):
    """L = 1 + a·ω: ∫L P₀ = 4π, ∫L P₁(ω·v) = (4π/3) a·v, ∫L P₂ = 0; for 65 536 stratified samples 3 ‰."""
    from rsibr.scene.config import EnvironmentConfig
    from rsibr.scene.environment import load_environment

    emitter = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "g.exr", gradient(gradient_axis)))).emitter()
    directions = icosphere(0).directions
    moments = zonal_moments(emitter, directions, 2)
    exact = np.stack([np.full(12, 4 * np.pi), 4 * np.pi / 3 * directions @ gradient_axis, np.zeros(12)], axis=1)
    assert np.abs(moments - exact[..., None]).max() < 3e-3 * 4 * np.pi


def test_the_mean_of_a_map_goes_with_the_area_in_the_disk():
    """A whole and two quarter texels: (L₁ + L₂/4 + L₃/4)/1.5, and the error of that sum of independent texels."""
    radiance = np.array([[1.0, 2, 3], [5, 6, 7], [9, 10, 11]])
    variance = np.array([[0.04, 0.04, 0.04], [0.16, 0.16, 0.16], [0.0, 0.48, 0.0]])
    mean, error = mean_of_map(radiance, variance, np.array([1.0, 0.25, 0.25]))
    assert mean == pytest.approx([(1 + 14 / 4) / 1.5, (2 + 16 / 4) / 1.5, (3 + 18 / 4) / 1.5])
    assert error == pytest.approx(np.sqrt([0.05, 0.08, 0.05]) / 1.5)


def test_a_drift_is_told_against_the_fit_to_the_other_views(rng, monkeypatch):
    """Means of an exact kernel, one of them off: the prediction is the kernel's, which that view has no part in."""
    directions = icosphere(0).directions
    moments = np.repeat(np.concatenate([np.ones((12, 1)), directions], axis=1)[..., None], 3, axis=2)
    monkeypatch.setattr("rsibr.validation.health.energy.zonal_moments", lambda *_: moments)
    kernel = 4 + directions @ np.array([0.5, 1.0, 0.25])
    means = np.repeat(kernel[:, None], 3, axis=1) * (1 + 1e-4 * rng.standard_normal((12, 3)))
    means[SICK] *= 1.33
    found = drifting_views(MapMeans(means, np.zeros((12, 3))), directions, {})
    assert {drift.view for drift in found} == {SICK}
    assert [drift.ratio for drift in found] == pytest.approx([1.33] * 3, rel=2e-3)


def test_p_values_are_uniform_without_a_drift(rng):
    """Studentised with the view left out, exactly Student's t: Kolmogorov–Smirnov, false-alarm rate 1e-4 each view."""
    directions = icosphere(0).directions
    fitted = np.stack([np.ones(12), *directions.T], axis=1) * [4.0, 1.0, 1.0, 2.0]
    kernels = rng.normal(size=(1500, 4)) @ fitted.T
    found = np.array([_left_out(fitted, means)[1] for means in kernels + 0.3 * rng.standard_normal(kernels.shape)])
    assert min(kstest(p_values, "uniform").pvalue for p_values in found.T) > 1e-4 / 12


def test_false_alarms_of_the_drift_are_as_rare_as_stated(rng, monkeypatch):
    """Random kernels of degree 3, Gaussian residuals of 30 %: 1e-3 a bake; 2000 show at most 9 (p = 5e-5)."""
    emitter = {"type": "envmap", "bitmap": _bitmap()}
    directions = icosphere(0).directions
    moments = zonal_moments(emitter, directions, 3)
    monkeypatch.setattr("rsibr.validation.health.energy.zonal_moments", lambda *_: moments)

    def alarms() -> list[Drift]:
        means = 5 + 0.3 * np.einsum("vlc,l->vc", moments, rng.normal(size=4)) + 1.5 * rng.standard_normal((12, 3))
        return drifting_views(MapMeans(means, np.zeros((12, 3))), directions, emitter)

    assert sum(bool(alarms()) for _ in range(2000)) <= 9


def _bitmap():
    import mitsuba as mi

    return mi.Bitmap(asymmetric().astype(np.float32))


def test_too_few_views_and_a_black_sky_show_no_drift():
    four = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    means = MapMeans(np.zeros((4, 3)), np.zeros((4, 3)))
    black = {"type": "constant", "radiance": 0.0}
    assert drifting_views(means, four, black) == []
    assert drifting_views(MapMeans(np.zeros((2, 3)), np.zeros((2, 3))), four[:2], black) == []


def test_the_share_near_a_singularity_is_its_area(rng):
    """At a triangle's centroid: three circles of radius 0.1 about the normals that halve v and −v_s, cut by the rim.

    Their area by 10⁶ points drawn at random, ± 0.6 %; on the grid of 64² texels ± 5 %.
    """
    viewpoints = icosphere(0)
    corners = viewpoints.directions[viewpoints.triangles[0]]
    centroid = corners.sum(axis=0) / np.linalg.norm(corners.sum(axis=0))
    halfway = (centroid - corners) / np.linalg.norm(centroid - corners, axis=1, keepdims=True)
    off_axis = np.linalg.norm(halfway - (halfway @ centroid)[:, None] * centroid, axis=1)
    p = rng.uniform(-1, 1, size=(10**6, 2))
    p = p[np.hypot(*p.T) < 1]
    area = np.mean(np.hypot(p[:, 0] - off_axis[0], p[:, 1]) < 0.1)
    assert np.ptp(off_axis) < 1e-9
    assert near_singularity(viewpoints, [centroid]) == pytest.approx(3 * area, rel=0.05)


def test_the_files_hold_what_was_found(sound, tmp_path):
    sick = tampered(sound, tmp_path / "s.rsibr", {SICK: with_value(sound.map(SICK), "radiance", (10, 21), np.nan)})
    out = tmp_path / "made" / "here"
    health = check(sick, out=out)
    told = json.loads((out / "health.json").read_text())
    assert HealthModel.model_validate(told) == HealthModel.of(health)
    assert told["trusted"] is False
    assert (
        told["findings"]["non_finite"]["places"][0] | {"view": SICK, "row": 10, "column": 21, "value": None}
        == (told["findings"]["non_finite"]["places"][0])
    )
    page = Page()
    page.feed((out / "health.html").read_text(encoding="utf-8"))
    assert "Unusable" in page.text
    assert f"{SICK}, 10, 21" in page.text
    assert page.open == []
    assert all(reference.startswith("data:image/webp;base64,") for reference in page.references)
    assert {path.name for path in (out / "pictures").iterdir()} == {f"health_view_{SICK:04d}.png"}
    check(sound, out=out)
    assert not (out / "pictures" / f"health_view_{SICK:04d}.png").exists()


def test_validate_reports_the_health_of_the_bake(sound, tmp_path):
    validate(sound, views=1, methods=["nearest"], samples=16, out=tmp_path)
    metrics = MetricsDocument.model_validate(json.loads((tmp_path / "metrics.json").read_text()))
    assert metrics.health.trusted
    assert set(metrics.health.findings) == set(KINDS)
    page = Page()
    page.feed((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "Health of the bake" in page.text
    assert "Nothing found" in page.text
    assert list((tmp_path / "pictures").glob("health_view_*.png"))


def test_validate_stops_at_nan_before_it_renders_and_says_where(sound, tmp_path, monkeypatch):
    sick = tampered(sound, tmp_path / "s.rsibr", {SICK: with_value(sound.map(SICK), "radiance", (10, 21), np.nan)})
    monkeypatch.setattr("rsibr.validation.validation.ReferenceRenderer", None)
    with pytest.raises(CheckFailed, match=r"1 texel in 1 view: non-finite.*rsibr check"):
        validate(sick, out=tmp_path / "report")
    assert (tmp_path / "report" / "health.html").exists()
    assert not (tmp_path / "report" / "report.html").exists()


def test_what_is_no_bake_is_refused(tmp_path):
    with pytest.raises(BakeError):
        check(tmp_path / "none.rsibr")


def test_the_functions_of_the_package_stay_functions_whichever_is_named_first():
    """`rsibr.check` imports the rooms `rsibr.bake` and `rsibr.validate`, which bear the names of functions."""
    script = (
        "import rsibr; rsibr.check; print([callable(getattr(rsibr, name)) for name in ('bake', 'check', 'validate')])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[True, True, True]"
