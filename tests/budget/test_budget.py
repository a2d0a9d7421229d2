"""Budgets of a whole bake: what is set stays, what is chosen is recorded, what cannot be promised is refused."""

import time
from pathlib import Path

import numpy as np
import pytest

import rsibr
from rsibr.baking.scene import Scene
from rsibr.budget.bake import planned
from rsibr.budget.choose import LEAST_SAMPLES, choose
from rsibr.budget.probe import ProbedScene, surrounding, upper_bound
from rsibr.errors import BakeError, InputError
from rsibr.geometry.viewpoints import icosphere
from rsibr.scene.config import parse_config, read_toml
from tests.scene.maps import write_exr

CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "glossy-plastic"
[sampling]
seed = 3
[budget]
error = 0.05
"""
SMALL = ["map.resolution=24"]


@pytest.fixture
def config(tmp_path, asymmetric_environment):
    path = tmp_path / "budget.toml"
    path.write_text(CONFIG.format(environment=asymmetric_environment))
    return path


def chosen(config, overrides):
    return choose(Scene.prepare(config, overrides), time.perf_counter())


def map_bytes(path):
    return {file.name: file.read_bytes() for file in sorted((path / "maps").iterdir())}


def test_error_is_promised_and_reached_and_all_of_it_recorded(config, tmp_path):
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=SMALL)
    budget = baked.manifest.budget
    assert budget.promised_error == 0.05
    assert baked.resolution == budget.chosen.resolution == 24
    assert baked.view_count == budget.chosen.views
    assert budget.forecast_error <= budget.promised_error
    assert budget.reached_error <= budget.promised_error
    assert budget.reached_ci95[0] <= budget.reached_error <= budget.reached_ci95[1]
    assert budget.reached_seconds >= baked.seconds
    assert budget.asked["budget"] == {"error": 0.05}
    assert "budget" not in budget.resolved


@pytest.mark.slow
def test_resumed_it_chooses_nothing_anew_and_ends_bit_identical(config, tmp_path, monkeypatch):
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=SMALL)
    kept = map_bytes(baked.path)
    for index in (0, 7):
        (baked.path / "maps" / f"view_{index:04d}.exr").unlink()
    monkeypatch.setattr("rsibr.budget.bake.choose", lambda *_: pytest.fail("chosen anew"))
    again = rsibr.bake(config, out=baked.path, overrides=SMALL)
    assert map_bytes(again.path) == kept
    assert again.manifest.budget.chosen == baked.manifest.budget.chosen
    changes = ["map.resolution=64", "budget.error=0.04", "budget.seconds=9", "sampling.seed=4", "sampling.clamp=2.0"]
    changes += ["sampling.samples=64", "views.subdivision=0", "effects.lobe_views=on"]
    for change in changes:  # whatever is set is held against what the finished bake was asked for
        with pytest.raises(BakeError, match=f"another config \\(.*{change.partition('=')[0]}: .* → .*--fresh"):
            rsibr.bake(config, out=baked.path, overrides=[*SMALL, change])
    for change, name in (("material.preset=matte-lambert", "material"), ("environment.scale=2.0", "environment")):
        with pytest.raises(BakeError, match=f"{name}.content: .* → .*--fresh"):
            rsibr.bake(config, out=baked.path, overrides=[*SMALL, change])
    plain = rsibr.bake(baked.manifest.budget.resolved, out=tmp_path / "plain.rsibr")
    with pytest.raises(BakeError, match=r"without a budget.*--fresh"):
        rsibr.bake(config, out=plain.path, overrides=SMALL)
    assert map_bytes(baked.path) == kept


@pytest.mark.slow
def test_a_finished_bake_is_held_against_the_content_of_its_files(config, tmp_path):
    sky = tmp_path / "sky.exr"
    sky.write_bytes(Path(parse_config(read_toml(config), tmp_path).environment.file).read_bytes())
    overrides = [*SMALL, f"environment.file={sky}", "sampling.samples=64"]
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=overrides)
    write_exr(sky, np.full((8, 16, 3), 0.5, np.float32))
    with pytest.raises(BakeError, match=r"environment.content: .* → "):
        rsibr.bake(config, out=baked.path, overrides=overrides)


@pytest.mark.slow
def test_a_bake_of_other_code_is_not_reused(config, tmp_path, monkeypatch):
    """One of the same version number too: it may hold other radiance."""
    overrides = [*SMALL, "sampling.samples=64"]
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=overrides)
    for place in ("planned_manifest", "finished"):
        monkeypatch.setattr(f"rsibr.baking.{place}.baking_code", lambda: "0" * 64)
    with pytest.raises(BakeError, match=r"code of rsibr: .* → 000000000000"):
        rsibr.bake(config, out=baked.path, overrides=overrides)


@pytest.mark.slow
def test_what_the_config_sets_stays(config):
    resolved, record = chosen(config, [*SMALL, "views.subdivision=1", "sampling.samples=100"])
    assert (resolved.map.resolution, resolved.views.subdivision, resolved.sampling.samples) == (24, 1, 100)
    assert resolved.sampling.seed == 3
    assert resolved.budget is None
    assert len(record.probes) == 1


@pytest.mark.slow
def test_seconds_choose_the_most_accurate_that_fits(config):
    resolved, record = chosen(config, [*SMALL, "budget.seconds=20"])
    assert record.promised_seconds == 20
    assert record.choice_seconds < 20
    assert record.chosen in record.probes
    assert resolved.sampling.decided_later or resolved.sampling.samples >= LEAST_SAMPLES
    best = min(probe.upper for probe in record.probes)
    assert record.chosen.upper <= best + 0.5 * record.forecast_error


@pytest.mark.parametrize(("key", "said"), [("error=1e-7", "the smallest possible is"), ("seconds=0.01", "are too few")])
def test_what_cannot_be_promised_is_refused_in_one_line(config, key, said):
    with pytest.raises(InputError, match=said) as refused:
        chosen(config, [*SMALL, "views.subdivision=0", f"budget.{key}"])
    assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_a_refusal_says_where_the_fit_of_the_lobes_is_bad(config):
    """Half of the light is sent back to where it came from, which no fitted lobe does; a plastic's lobes are fitted."""
    small = ["map.resolution=24", "views.subdivision=0", "budget.error=1e-7"]
    retro = "material.bsdf={type='rsibr_car_paint', retro_share=0.5}"
    with pytest.raises(InputError, match=r"fitted lobes err by .* % at \d+°: store more views") as refused:
        chosen(config, [*small, retro])
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError) as refused:
        chosen(config, small)
    assert "fitted" not in str(refused.value)


@pytest.mark.slow
def test_a_plan_shows_what_would_be_chosen(config):
    plan, _, record = planned(config, SMALL)
    assert plan.resolution == record.chosen.resolution == 24


@pytest.mark.parametrize("subdivision", [0, 1, 2])
def test_few_stored_views_keep_the_triangles_around_the_new_ones(subdivision, rng):
    every = icosphere(subdivision)
    views = [view / np.linalg.norm(view) for view in rng.normal(size=(6, 3))]
    fewer, needed = surrounding(every, views)
    assert len(fewer) <= min(len(every), 3 * 6 + 12)
    for view in views:
        corners = every.directions[every.triangles]
        inside = np.linalg.solve(corners.transpose(0, 2, 1), np.broadcast_to(view, (len(corners), 3))[..., None])
        around = corners[inside[..., 0].min(axis=1).argmax()]
        found = fewer.directions[fewer.triangles]
        match = [sorted(map(tuple, one.round(6))) == sorted(map(tuple, around.round(6))) for one in found]
        assert sum(match) == 1
        assert set(fewer.triangles[match.index(True)].tolist()) <= needed


@pytest.mark.slow
def test_a_probe_tells_bias_from_noise(config):
    """Four times the samples: a quarter of the noise or less (strata), and the same bias within its scatter.

    Noise that the method does not carry, because it does not trust the residuals, need not fall.
    """
    scene = Scene.prepare(config, SMALL)
    few, many = (
        probed.probe(24, probed.viewpoints(scene.config.views))
        for probed in (ProbedScene(scene), ProbedScene(scene, samples=64))
    )
    assert many.samples == 4 * few.samples
    assert many.noise < max(0.35 * few.noise, 0.01 * many.bias)
    assert abs(many.bias - few.bias) < max(few.noise, 0.1 * few.bias)


def test_the_upper_bound_holds_as_often_as_it_says(rng):
    """Mean over eight more views below it in 90 % of cases; 4000 trials, 4 σ: false-alarm rate 6e-5."""
    below = 0
    for _ in range(4000):
        errors = rng.normal(1.0, 0.3, size=18)
        below += errors[10:].mean() <= upper_bound(errors[:10])
    assert abs(below / 4000 - 0.9) < 4 * np.sqrt(0.09 / 4000)
