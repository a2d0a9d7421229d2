"""The prepared scene: every part of it is made once, whoever asks, and a finished bake asks for none."""

import time
from collections import Counter

import drjit as dr
import numpy as np
import pytest

import rsibr
from rsibr.baking import finished, loader, parts
from rsibr.baking.finished import finished_bake
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.remembered import Remembered, in_this_process
from rsibr.baking.scene import Scene
from rsibr.lobes.split import LobeSplit
from rsibr.scene.config import load_config
from rsibr.store import bake as bake_store
from rsibr.validation.health import health
from rsibr.validation.validation import validate

CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "glossy-plastic"
[map]
resolution = 16
[sampling]
samples = 16
seed = 7
"""
LOADED = {"environment": 1, "material": 1}
PROBED = {"material probe": 1, "light probe": 1}
DECODED = {"decoded maps": 12, "decoded lights": 1}


@pytest.fixture
def config(tmp_path, asymmetric_environment):
    path = tmp_path / "small.toml"
    path.write_text(CONFIG.format(environment=asymmetric_environment))
    return path


@pytest.fixture
def made(monkeypatch):
    """Count how often each part of a scene is made, by a process that has made none yet."""
    in_this_process.forget()
    counts = Counter()

    def counted(place, name, label):
        real = getattr(place, name)

        def call(*arguments, **keywords):
            counts[label] += 1
            return real(*arguments, **keywords)

        monkeypatch.setattr(place, name, call)

    counted(loader, "load_environment", "environment")
    counted(health, "load_environment", "environment")
    counted(loader, "load_material", "material")
    counted(parts, "probe_material", "material probe")
    counted(parts, "probe_light", "light probe")
    counted(parts, "light_of", "light")
    counted(LobeSplit, "of", "fit")
    counted(bake_store, "decode_map", "decoded maps")
    counted(bake_store, "decode_light", "decoded lights")
    counted(SphereIntegrator, "__init__", "integrator")
    counted(rsibr.baking.scene, "make_plan", "plan")
    return counts


def test_one_bake_makes_each_part_once(config, tmp_path, made):
    rsibr.bake(config, out=tmp_path / "b.rsibr")
    assert made == LOADED | {**PROBED, "fit": 1, "plan": 1, "light": 1, "integrator": 1}


@pytest.mark.slow
def test_a_budget_bake_makes_each_part_once_for_choice_bake_and_what_was_reached(config, tmp_path, made):
    """The choice, the bake and the judgement each have a plan of their own, of the one set of probes."""
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=["budget.error=0.2"])
    assert baked.manifest.budget.reached_error is not None
    assert made.pop("plan") == 3
    assert made == LOADED | {**PROBED, "fit": 1, "light": 1, "integrator": 1, **DECODED}


@pytest.mark.slow
def test_one_validation_loads_once_and_fits_nothing_again(config, tmp_path, made):
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr")
    made.clear()
    found = validate(baked, views=[[1, 2, 3]], samples=64)
    assert found.lobe_summary
    assert made == LOADED | {"integrator": 1, **DECODED}  # the fit of the bake is remembered


def test_a_validation_of_a_prepared_scene_loads_nothing(config, tmp_path, made):
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr")
    scene = Scene.prepare(config)
    made.clear()
    validate(baked, views=[[1, 2, 3]], samples=64, methods=["nearest"], lobes=False, scene=scene)
    assert made == {"decoded maps": 12}


@pytest.mark.parametrize(
    "overrides", [[], ["budget.error=0.2"], ["sampling.samples=auto", "sampling.target_error=0.1"]]
)
def test_a_finished_bake_called_again_makes_nothing_and_is_quick(config, tmp_path, made, overrides):
    first = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=overrides)
    made.clear()
    start = time.process_time()  # of all threads: a busy machine does not lengthen it
    again = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=overrides)
    assert time.process_time() - start < 1
    assert not made
    assert again.manifest == first.manifest


def test_what_was_left_open_stays_so_in_the_manifest_which_bakes_and_plans_again(config, tmp_path, made):
    overrides = ["map.resolution=auto", "sampling.samples=8", "effects.resolution=off"]
    baked = rsibr.bake(config, out=tmp_path / "b.rsibr", overrides=overrides)
    assert baked.config == load_config(config, overrides).to_dict()
    assert baked.config["map"] == {"resolution": "auto"}
    assert baked.resolution == rsibr.plan(baked.config).resolution < 256
    made.clear()
    assert rsibr.bake(baked.config, out=baked.path).manifest == baked.manifest
    assert not made


def test_what_is_not_the_same_bake_is_not_finished(config, tmp_path, gradient_sky, monkeypatch):
    settings = load_config(config)
    baked = rsibr.bake(settings, out=tmp_path / "b.rsibr")
    assert finished_bake(settings, baked.path) is not None
    assert finished_bake(settings, tmp_path / "none.rsibr") is None
    assert finished_bake(load_config(config, ["sampling.seed=8"]), baked.path) is None
    assert finished_bake(settings, baked.path, {"environment": "another"}) is None
    with monkeypatch.context() as patch:
        patch.setattr(finished, "package_versions", lambda: dict.fromkeys(finished.RECORDED, "0"))
        assert finished_bake(settings, baked.path) is None
    (baked.path / "maps" / "view_0003.exr").unlink()
    assert finished_bake(settings, baked.path) is None


def test_files_that_have_changed_are_noticed(config, tmp_path, gradient_sky, asymmetric_environment):
    sky, paint, views = tmp_path / "sky.exr", tmp_path / "paint.xml", tmp_path / "views.json"
    sky.write_bytes(asymmetric_environment.read_bytes())
    paint.write_text('<bsdf version="3.0.0" type="roughconductor"><float name="alpha" value="0.3"/></bsdf>')
    octahedron = np.vstack([np.eye(3), -np.eye(3)])
    views.write_text(f'{{"directions": {octahedron.tolist()}}}')
    keys = [f"environment.file={sky}", f"material.file={paint}", f"views.file={views}"]
    settings = load_config(config, keys)
    baked = rsibr.bake(settings, out=tmp_path / "b.rsibr")
    for file, content in (
        (sky, gradient_sky.read_bytes()),
        (paint, paint.read_bytes().replace(b"0.3", b"0.2")),
        (views, f'{{"directions": {octahedron[::-1].tolist()}}}'.encode()),
    ):
        assert finished_bake(settings, baked.path) is not None
        before = file.read_bytes()
        file.write_bytes(content)
        assert finished_bake(settings, baked.path) is None
        file.write_bytes(before)


def test_a_scene_of_another_size_shares_what_no_size_decides(config, made):
    scene = Scene.prepare(config)
    other = scene.resized(load_config(config, ["map.resolution=32", "sampling.samples=64"]))
    assert (scene.resolution, other.resolution) == (16, 32)
    assert other.light is scene.light
    assert other.lobes is scene.lobes
    assert [s.integrator.coverage.shape[0] for s in (scene, other)] == [16, 32]
    assert made == LOADED | {**PROBED, "fit": 1, "plan": 2, "light": 1, "integrator": 1}
    with pytest.raises(ValueError, match="the material"):
        scene.resized(load_config(config, ["material.preset=matte-lambert"]))


def test_scenes_of_one_loader_share_what_they_name_alike(config, made):
    sharing = loader.Loader()
    one, other, matte = (
        Scene.prepare(config, overrides, sharing)
        for overrides in ([], ["map.resolution=32"], ["material.preset=matte-lambert"])
    )
    assert one.environment is other.environment is matte.environment
    assert one.material is other.material is not matte.material
    assert made == {"environment": 1, "material": 2}
    assert one.parts.seconds == other.parts.seconds > 0  # each counts the time, whoever loaded them


def test_what_was_released_is_made_again_and_what_scenes_share_is_not(config, made):
    scene = Scene.prepare(config)
    loaded = scene.parts.seconds
    before = scene.parts.split.names
    assert scene.parts.seconds > loaded
    scene.parts.release()
    assert scene.parts.seconds == loaded
    assert scene.parts.split.names == before
    assert made == LOADED | {"fit": 1}
    assert scene.parts.seconds > loaded  # counts as if it had been made again


def test_materials_and_skies_in_turn_are_probed_and_fitted_once_each(config, made, tmp_path, gradient_sky):
    """Two materials under two skies: four bakes, whose lights are two files."""
    for sky in ([], [f"environment.file={gradient_sky}"]):
        for material in ("glossy-plastic", "solid-red"):
            name = f"{material}-{len(sky)}.rsibr"
            overrides = [*sky, f"material.preset={material}"]
            rsibr.bake(config, out=tmp_path / name, overrides=overrides, lights=tmp_path / "lights")
    assert [made[name] for name in ("fit", "material probe", "light probe", "light")] == [2, 2, 2, 2]
    assert len(list((tmp_path / "lights").iterdir())) == 2


@pytest.mark.slow
def test_what_is_remembered_goes_by_content_and_changes_no_bit(config, tmp_path, gradient_sky, asymmetric_environment):
    """A sky that changes under its name is another sky; one that comes back is the same."""
    sky = tmp_path / "sky.exr"
    overrides, bits = [f"environment.file={sky}"], []
    for content, forget in ((asymmetric_environment, True), (gradient_sky, False), (asymmetric_environment, False)):
        sky.write_bytes(content.read_bytes())
        if forget:
            in_this_process.forget()
        baked = rsibr.bake(config, out=tmp_path / f"{len(bits)}.rsibr", overrides=overrides)
        bits.append([*(state.sha256 for state in baked.manifest.views), baked.manifest.light.sha256])
    assert bits[0] == bits[2]
    assert not set(bits[0]) & set(bits[1])


@pytest.mark.slow
def test_a_bake_of_a_known_sky_and_material_compiles_nothing(config, tmp_path):
    """Nor one of another material of the same kind under a known sky, if both were met before."""
    turned = "environment.rotation_deg=90"
    pairs = [("clearcoat-red", []), ("candy-red", []), ("clearcoat-red", [turned])]
    for place, (material, sky) in enumerate(pairs):
        rsibr.bake(config, out=tmp_path / f"{place}.rsibr", overrides=[*sky, f"material.preset={material}"])
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        rsibr.bake(config, out=tmp_path / "last.rsibr", overrides=[turned, "material.preset=candy-red"])
        kernels = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
    assert kernels
    assert all(kernel["cache_hit"] and not kernel["cache_disk"] for kernel in kernels)


def test_the_longest_unused_is_forgotten_first_and_memory_is_bounded():
    kept = Remembered(most_bytes=100)
    for name in "abc":
        kept.keep(name, name.upper(), 0.5, 40)
        kept.find("a")
    assert kept.find("a") == ("A", 0.5)
    assert kept.find("b") is None
    assert kept.find("c") == ("C", 0.5)
    kept.keep("huge", "HUGE", 0.5, 101)
    assert kept.find("huge") is None
    kept.keep("a", "new", 0.1, 100)
    assert (kept.find("a"), kept.find("c"), kept.size) == (("new", 0.1), None, 100)
