"""A lobe's own number of views: layers by view, the same sum in all of them, each lobe from its own views."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rsibr.baking import view
from rsibr.baking.baker import bake
from rsibr.errors import BakeError
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.warp_blend.lobe_warp import LobeWarpMethod
from rsibr.store.layers import layered, layers_at
from rsibr.store.manifest import LobeRecord, Manifest
from rsibr.store.map_file import MapFile
from rsibr.studies.noise import noisy_maps
from rsibr.studies.variants import half_maps
from rsibr.validation.health.health import assess
from rsibr.validation.validation import validate

N = 16
CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "metallic-blue"
[views]
subdivision = 1
[map]
resolution = 16
[sampling]
samples = 16
adaptive = false
seed = 3
"""
ROUNDING = 4 * np.finfo(np.float32).eps
"""Of sums of three numbers in another order, relative to the greatest."""

FRAMES = [view_frame(view) for view in ([1, 2, 3], [-0.3, 0.2, -0.9], [0.6, -1, 0.1])]


@pytest.fixture(scope="module")
def config(tmp_path_factory, asymmetric_environment):
    path = tmp_path_factory.mktemp("layers") / "config.toml"
    path.write_text(CONFIG.format(environment=asymmetric_environment))
    return path


@pytest.fixture(scope="module")
def bakes(config):
    """42 views with all lobes in each, as planned, and with as few as can be; and 12 views."""
    settings = {name: [f"effects.lobe_views={name}"] for name in ("on", "auto", "off")}
    settings["12"] = ["views.subdivision=0"]
    return {name: bake(config, out=config.parent / name, overrides=changed) for name, changed in settings.items()}


@pytest.fixture(scope="module")
def methods(bakes):
    return {name: MethodSet(baked) for name, baked in bakes.items()}


@pytest.fixture(scope="module")
def lobes(bakes):
    """Matte base, flakes and coat: of 42 views the flakes need all, by the plan, and the others 12."""
    return [record.name for record in bakes["on"].manifest.lobes]


def lobe(name, views):
    return LobeRecord(name=name, alpha=0.1, albedo=(), views=views)


def image(method, frame=FRAMES[0]):
    return method.map(frame, N).numpy()[..., :3]


def test_layers_go_by_the_view():
    lobes = [lobe("a", 12), lobe("b", 162), lobe("c", 42), lobe("d", 12)]
    apart = {name: [name] for name in "abcd"}
    assert layers_at(lobes, 11) == apart
    assert layers_at(lobes, 12) == {"rest": ["a", "d"], "b": ["b"], "c": ["c"]}
    assert layers_at(lobes, 42) == {"rest": ["a", "c", "d"], "b": ["b"]}
    assert layers_at(lobes, 162) == {"radiance": ["a", "b", "c", "d"]}


def test_one_lobe_alone_is_never_added_to_nothing():
    assert layers_at([lobe("a", 12), lobe("b", None)], 41) == {"a": ["a"], "b": ["b"]}
    assert layers_at([lobe("a", 12)], 41) == layers_at([lobe("a", None)], 0) == {"radiance": ["a"]}
    assert list(layers_at([], 3)) == ["radiance"]


def test_a_record_older_than_the_field_keeps_all_lobes_in_all_views():
    old = [LobeRecord.model_validate({"name": name, "alpha": 0.1, "albedo": []}) for name in "ab"]
    assert layers_at(old, 10_000) == {"a": ["a"], "b": ["b"]}


@pytest.mark.parametrize("views", [11, 13, 42, 162])
def test_a_manifest_of_views_that_are_not_nested_is_refused(bakes, views):
    content = bakes["auto"].manifest.model_dump(mode="json")
    content["lobes"][0]["views"] = views
    with pytest.raises(ValueError, match=f"cannot be kept apart in {views} of 42 views"):
        Manifest.model_validate(content)


@pytest.mark.parametrize("done", [(12, 12, None), (12, None, 12), (12, 12, 12)])
def test_what_is_added_up_has_the_same_sum(rng, done):
    """Bit for bit where the lobes that are done are the first; a NaN is not lost."""
    images = rng.gamma(0.3, 2.0, (3, N, N, 3)).astype(np.float32)
    images[2, 3, 4] = np.nan
    names = dict(zip("abc", images, strict=True))
    whole = MapFile(FRAMES[0][:, 2], FRAMES[0], names, None, np.ones((N, N), np.float32))
    records = [lobe(name, views) for name, views in zip("abc", done, strict=True)]
    assert layered(whole, records, 11) is whole
    fewer = layered(whole, records, 12)
    assert list(fewer.layers) == (["radiance"] if None not in done else ["rest", "abc"[done.index(None)]])
    tolerance = 0 if done[1] else ROUNDING
    np.testing.assert_allclose(fewer.radiance, whole.radiance, rtol=tolerance)


def test_a_bake_has_the_layers_that_its_manifest_says(bakes, lobes):
    assert [record.views for record in bakes["auto"].manifest.lobes] == [12, None, 12]
    expected = {"on": lobes, "auto": ["rest", lobes[1]], "off": ["radiance"]}
    for name, layers in expected.items():
        for index in (0, 11):
            assert list(bakes[name].map(index).layers) == lobes
        for index in (12, 41):
            assert list(bakes[name].map(index).layers) == layers
            assert list(layers_at(bakes[name].manifest.lobes, index)) == layers


def test_every_view_keeps_its_sum_its_variance_and_its_samples(bakes, lobes):
    for index in (0, 11, 12, 30, 41):
        full, planned, fewest = (bakes[name].map(index) for name in ("on", "auto", "off"))
        assert np.array_equal(full.radiance, fewest.radiance)
        assert np.abs(full.radiance - planned.radiance).max() <= ROUNDING * full.radiance.max()
        for fewer in (planned, fewest):
            assert np.array_equal(full.variance, fewer.variance)
            for name in set(fewer.layers) & set(lobes):
                assert np.array_equal(full.layers[name], fewer.layers[name])
    assert np.array_equal(planned.layers["rest"], full.layers[lobes[0]] + full.layers[lobes[2]])


def test_the_plan_says_what_was_saved(bakes):
    """From the size of whole maps; the light comes on top, the same in each."""
    plans = {name: bakes[name].manifest.plan for name in ("on", "auto", "off")}
    sizes = {name: sum(state.bytes for state in bakes[name].manifest.views) for name in plans}
    assert sizes["off"] < sizes["auto"] < sizes["on"]
    for name in ("auto", "off"):
        saved = plans[name]["lobe_views"].saved_bytes
        assert saved == pytest.approx(sizes["on"] - sizes[name], rel=0.2)
        assert plans[name].bytes - bakes[name].manifest.light.bytes == pytest.approx(sizes[name], rel=0.1)
    assert plans["on"]["lobe_views"].cost_bytes > 0
    assert not any(effect.missed for effect in plans["auto"].effects)


@pytest.mark.slow
def test_the_method_reads_the_sum_and_sees_no_difference(methods):
    for method in ("cabral1999", "rsibr"):
        for frame in FRAMES:
            full, planned, fewest = (image(methods[name][method], frame) for name in ("on", "auto", "off"))
            assert np.array_equal(full, fewest)
            assert np.abs(full - planned).max() < 1e-5 * full.max()  # maps are packed in 18 bits a channel


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "which"), [("rsibr", (0, 1, 2)), ("rsibr-fine", (0,))])
def test_a_lobe_with_twelve_views_is_that_of_a_bake_of_twelve(bakes, methods, lobes, kind, which):
    """Bit for bit: nested views have the same directions, and equal views the same samples.

    What is believed of the model is learnt from the views of a bake: here it is that of the other one.
    """
    for k in which:
        alike, planned = methods["on" if k == 1 else "12"], MethodSet(bakes["auto"])
        expected = image(alike.variant(kind, lobe=lobes[k]))
        planned.inputs.learnt.update(alike.inputs.learnt)
        assert np.array_equal(image(planned.variant(kind, lobe=lobes[k])), expected)


@pytest.mark.slow
def test_lobes_warped_apart_are_each_warped_from_their_own_views(methods):
    twelve, full, planned, fewest = (LobeWarpMethod.of(methods[name].inputs) for name in ("12", "on", "auto", "off"))
    assert [len(group.lobes) for group in planned.groups] == [2, 1]
    assert [len(group.lobes) for group in full.groups] == [len(group.lobes) for group in fewest.groups] == [3]
    for frame in FRAMES:
        assert np.array_equal(image(fewest, frame), image(twelve, frame))
        flakes, others = (
            replace(whole, groups=[replace(whole.groups[0], lobes=[whole.groups[0].lobes[k] for k in chosen])])
            for whole, chosen in ((full, [1]), (twelve, [0, 2]))
        )
        expected = image(flakes, frame) + image(others, frame)
        assert np.abs(image(planned, frame) - expected).max() < 1e-5 * expected.max()
        assert np.abs(image(full, frame) - expected).max() > 1e-3 * expected.max()  # it makes a difference


@pytest.mark.slow
def test_the_parts_miss_the_whole_between_the_views_that_keep_them_apart(bakes, methods, lobes):
    """Not at these views. The whole is uncut here, as its parts are; in all views of the others they add up to it."""
    whole = replace(methods["auto"]["rsibr"], keeps_negatives=True)
    parts = [methods["auto"].variant("rsibr", lobe=part) for part in lobes]
    at_stored, between = (
        np.abs(sum(image(part, frame) for part in parts) - image(whole, frame)).max() / image(whole, frame).max()
        for frame in (bakes["auto"].map(5).frame, FRAMES[0])
    )
    assert at_stored < 1e-4
    assert between > 1e-3


def test_a_killed_bake_ends_with_the_same_files(bakes, config, tmp_path, monkeypatch):
    def dying(*arguments, index, **options):
        if index == 20:
            raise KeyboardInterrupt
        return whole(*arguments, index=index, **options)

    whole = view.bake_view
    with monkeypatch.context() as killed:
        killed.setattr(view, "bake_view", dying)
        with pytest.raises(KeyboardInterrupt):
            bake(config, out=tmp_path / "b")
    resumed = bake(config, out=tmp_path / "b")
    checksums = ([state.sha256 for state in found.manifest.views] for found in (resumed, bakes["auto"]))
    assert next(checksums) == next(checksums)


def test_a_bake_of_other_layers_is_not_continued(bakes, config):
    for one, other in pairwise(("on", "auto", "off")):
        with pytest.raises(BakeError, match="lobe_views"):
            bake(config, out=bakes[one].path, overrides=[f"effects.lobe_views={other}"])


@pytest.mark.slow
def test_a_bake_with_a_rest_is_healthy_judged_and_studied_like_any(bakes, lobes):
    health = {name: assess(bakes[name], FRAMES[0][None, :, 2]) for name in ("on", "auto")}
    assert health["auto"].trusted
    for kind, finding in health["auto"].findings.items():
        assert finding.texels == health["on"].findings[kind].texels
    found = validate(bakes["auto"], views=[FRAMES[0][:, 2]], methods=["rsibr"], samples=64)
    assert list(found.lobe_summary) == lobes
    for altered in (half_maps(bakes["auto"]), noisy_maps(bakes["auto"], seed=0)):
        assert np.isfinite(image(LobeWarpMethod.of(MethodSet(altered).inputs))).all()
