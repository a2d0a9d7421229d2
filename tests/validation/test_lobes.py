"""Which lobe makes the largest error: debiased parts, and a judge that finds the lobe that was spoilt."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.baking.scene import Scene
from rsibr.errors import BakeError, InputError
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.scene.config import Config
from rsibr.validation import lobes
from rsibr.validation.lobes import LobeJudge, has_lobes, lobe_errors
from rsibr.validation.metrics import denominator
from rsibr.validation.validation import validate

VIEW = [0.3, 0.5, 0.8]


@pytest.fixture(scope="module")
def config(asymmetric_environment):
    material = {"bsdf": {"type": "roughplastic", "alpha": 0.1, "diffuse_reflectance": 0.3}}
    return Config.model_validate(
        {
            "environment": {"file": str(asymmetric_environment)},
            "material": material,
            "map": {"resolution": 24},
            "sampling": {"samples": 256, "seed": 3},
        }
    )


@pytest.fixture(scope="module")
def baked(config, tmp_path_factory):
    return bake(config, out=tmp_path_factory.mktemp("lobes") / "plastic.rsibr")


@pytest.fixture(scope="module")
def scene(config):
    return Scene.prepare(config)


def test_errors_are_shares_of_the_whole_and_free_of_the_references_noise(rng):
    """Two lobes, the darker one 10 % off. False alarms: 0.3 %, Student's t beyond 5, 7 degrees of freedom, twice."""
    truth = np.stack([np.full((4000, 3), 1.0), np.full((4000, 3), 0.25)], axis=1)
    parts = truth * np.array([1.0, 1.1])[:, None]
    buffers = truth * (1 + 0.14 * rng.standard_normal((8, *truth.shape)))  # 5 % of the mean
    whole = denominator(truth.sum(axis=1)).mean()
    expected, undebiased = 0.025**2 / whole, ((parts - buffers.mean(axis=0)) ** 2).mean(axis=(0, 2)) / whole
    good, bad = lobe_errors(parts, buffers)
    assert abs(good.value) < 5 * good.standard_error < 0.1 * undebiased[0]
    assert abs(bad.value - expected) < 5 * bad.standard_error < 0.1 * expected
    assert undebiased[1] > 1.2 * expected


@pytest.mark.parametrize("kind", ["rsibr", "rsibr-fine"])
def test_the_parts_of_the_lobes_add_up_to_the_map(baked, kind):
    """Exact but for the packing of the residuals: 8e-6 of a texel's greatest channel, in each part and in the whole."""
    make, frame = partial(MethodSet(baked).variant, kind), view_frame(VIEW)
    whole = make().map(frame, 24).numpy()[..., :3]
    parts = [make(lobe=record.name).map(frame, 24).numpy()[..., :3] for record in baked.manifest.lobes]
    assert len(parts) == 2
    assert all(part.max() > 0.05 * whole.max() for part in parts)
    assert np.abs(sum(parts) - whole).max() < 5e-5 * whole.max()


def test_a_part_comes_back_exactly_at_a_stored_view(baked):
    stored = baked.map(4)
    for record in baked.manifest.lobes:
        part = MethodSet(baked).variant("rsibr", lobe=record.name).map(stored.frame, 24).numpy()[..., :3]
        inside = stored.coverage > 0.99
        assert np.abs(part - stored.layers[record.name])[inside].max() < 2e-3 * stored.radiance.max()


def test_a_lobe_that_is_not_there_is_no_part(baked):
    methods = MethodSet(baked)
    for name in ("rsibr", "rsibr-fine"):
        with pytest.raises(KeyError):
            methods.variant(name, lobe="velvet")


def test_lobes_are_held_against_a_reference_of_samples_of_their_own(baked, scene):
    judge = LobeJudge(baked, scene, MethodSet(baked), samples=256, buffers=8)
    stored = baked.map(0)
    found = judge.at(np.asarray(stored.frame, dtype=np.float64))
    assert list(found.errors) == scene.parts.split.names
    assert sum(error.light for error in found.errors.values()) == pytest.approx(1)
    assert (found.samples, found.buffers) == (256, 8)
    inside_the_disk = {name: (stored.coverage[..., None] * e.reference).sum() for name, e in found.errors.items()}
    whole = sum(inside_the_disk.values())
    for name, light in inside_the_disk.items():
        assert found.errors[name].light == pytest.approx(light / whole, rel=1e-5)
    for name, error in found.errors.items():
        assert np.abs(error.reference - stored.layers[name]).max() > 0  # not the bake's samples
        inside = stored.coverage > 0.5
        assert error.reference[inside].mean() == pytest.approx(stored.layers[name][inside].mean(), rel=0.02)
        assert np.isnan(error.relative_error[0, 0])


@pytest.mark.parametrize("spoilt", [0, 1])
def test_the_judge_finds_the_lobe_that_was_spoilt(baked, scene, monkeypatch, spoilt):
    judge = LobeJudge(baked, scene, MethodSet(baked), samples=128, buffers=8)
    name = baked.manifest.lobes[spoilt].name

    def brighter(part, frame, resolution):
        made = run(part, frame, resolution)
        return replace(made, image=made.image * (1.5 if part.name.endswith(name) else 1))

    monkeypatch.setattr(lobes, "run", brighter)
    assert judge.at(view_frame(VIEW)).worst == name


def test_lobes_take_part_where_there_are_several_and_rsibr_is_judged(baked, tmp_path):
    assert has_lobes(baked, ["nearest", "rsibr"], None)
    assert not has_lobes(baked, ["nearest"], None)
    assert not has_lobes(baked, ["rsibr"], False)
    found = validate(baked, views=[VIEW], methods=["rsibr"], samples=64, out=tmp_path)
    assert set(found.lobe_summary) == {record.name for record in baked.manifest.lobes}
    assert not validate(baked, views=[VIEW], methods=["rsibr"], samples=64, lobes=False).lobes


def test_lobes_that_are_not_there_are_a_mistake_of_the_user(config, tmp_path):
    one = config.model_copy(update={"material": config.material.model_copy(update={"bsdf": {"type": "diffuse"}})})
    alone = bake(one, out=tmp_path / "matte.rsibr")
    with pytest.raises(InputError, match="only one lobe"):
        has_lobes(alone, ["rsibr"], True)
    assert not has_lobes(alone, ["rsibr"], None)


def test_lobes_of_another_version_are_refused(baked, scene):
    renamed = tuple(record.model_copy(update={"name": f"old-{record.name}"}) for record in baked.manifest.lobes)
    old = replace(baked, manifest=baked.manifest.model_copy(update={"lobes": renamed}))
    with pytest.raises(BakeError, match="Bake it again"):
        LobeJudge(old, scene, MethodSet(baked), samples=64, buffers=8)


def test_a_lobe_that_the_plan_left_out_is_wrong_by_all_of_it(config, tmp_path):
    less = config.model_copy(
        update={"effects": config.effects.model_copy(update={"clear_coat": "off", "glossy": "off"})}
    )
    baked = bake(less, out=tmp_path / "dull.rsibr")
    assert [record.name for record in baked.manifest.lobes] == ["diffuse"]
    found = validate(baked, views=[VIEW], methods=["rsibr"], samples=256).views[0].lobes
    (missing,) = set(found.errors) - {"diffuse"}
    assert found.worst == missing
    assert not found.errors[missing].image.any()
    assert found.errors[missing].light > 0.05
    assert found.errors["diffuse"].rel_mse.value < 0.01 * found.errors[missing].rel_mse.value
