"""Validation of pictures of an object from a small bake, end to end."""

from __future__ import annotations

import json
import time
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.occlusion.occlusion import Occlusion
from rsibr.shading.pictures.picture import Picture
from rsibr.shading.renderer import ObjectRenderer
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.validation.objects import validation as module
from rsibr.validation.objects.validation import validate_object
from tests.validation.objects.doubles import bowl

CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "matte-lambert"
[map]
resolution = 24
[sampling]
samples = 64
[effects]
view_dependence = "on"
"""


@pytest.fixture(scope="module")
def matte(tmp_path_factory, asymmetric_environment):
    folder = tmp_path_factory.mktemp("matte")
    config = folder / "matte.toml"
    config.write_text(CONFIG.format(environment=asymmetric_environment))
    return bake(config, out=folder / "matte.rsibr")


@pytest.fixture(scope="module")
def scene(variant):
    shapes = {"bowl": bowl(24, 48), "ball": mi.load_dict({"type": "sphere", "center": [2.2, 0, 0], "radius": 0.8})}
    return ObjectScene("bowl and ball", shapes)


CAMERA = Camera.look_at((1.1, 4.0, 4.0), (1.1, -0.2, 0), fov_deg=45, width=32, height=24)


@pytest.fixture(scope="module")
def found(matte, scene, tmp_path_factory):
    out, steps, forecasts = tmp_path_factory.mktemp("report"), [], []
    made = validate_object(
        scene,
        {"*": matte},
        camera=CAMERA,
        methods=["rsibr"],
        samples=256,
        rays=4,
        out=out,
        on_progress=lambda *step: steps.append(step),
        on_forecast=forecasts.append,
    )
    return SimpleNamespace(made=made, out=out, steps=steps, forecasts=forecasts)


def test_shadows_and_bounces_are_told_from_reconstruction(found):
    causes = {cause.name: cause.rel_mse for cause in found.made.causes}
    best = found.made.methods["rsibr"]
    assert causes["visibility"].ci95[0] > 0.01  # the bowl hides half the sky from itself
    assert causes["bounces"].ci95[0] > 1e-3
    assert best.open.whole.rel_mse.value < 1e-3
    assert best.unoccluded.whole.rel_mse.ci95[0] > 10 * best.open.whole.rel_mse.ci95[1]
    assert best.unoccluded.whole.energy_ratio.ci95[0] > 1.05  # too bright without the shadows
    assert best.full.whole.rel_mse.ci95[1] < best.unoccluded.whole.rel_mse.ci95[0] / 2  # the occlusion of the picture
    assert found.made.plan["self_occlusion"].on
    assert set(found.made.zone_shares) == {"silhouette", "curved"}


def test_progress_and_forecast_are_told_and_the_report_is_written(found):
    assert [done for done, _ in found.steps] == list(range(7))
    assert {total for _, total in found.steps} == {6}
    assert len(found.forecasts) == 1
    assert found.forecasts[0].memory > 0
    assert (found.out / "report.html").stat().st_size > 10_000
    assert json.loads((found.out / "object.json").read_text())["scene"] == "bowl and ball"


def test_a_wrong_picture_is_found_wrong(matte, scene, monkeypatch):
    """A renderer that flips its picture, or dims it, fails against every truth."""
    errors = {}
    for name, fault in {
        "right": lambda image: image,
        "mirrored": lambda image: image[:, ::-1],
        "dim": lambda image: image * np.float32(0.9),
    }.items():

        class Faulty(ObjectRenderer):
            def picture(self, camera, rays, fault=fault):
                made = super().picture(camera, rays)
                return Picture(**{**vars(made), "radiance": fault(made.radiance)})

        monkeypatch.setattr(module, "ObjectRenderer", Faulty)
        made = validate_object(
            scene, {"*": matte}, camera=CAMERA, methods=["rsibr"], occlusion="off", samples=256, rays=4
        )
        errors[name] = made.methods["rsibr"].open.whole
    assert errors["right"].rel_mse.value < 2e-3
    assert errors["dim"].rel_mse.ci95[0] > 4e-3
    assert errors["dim"].energy_ratio.value == pytest.approx(0.9 * errors["right"].energy_ratio.value, rel=1e-3)
    assert errors["mirrored"].rel_mse.ci95[0] > 0.05


def test_what_cannot_be_judged_is_refused_in_one_line(matte, scene):
    def refused(match, bakes=None, **options):
        with pytest.raises(InputError, match=match):
            validate_object(scene, bakes or {"*": matte}, **{"camera": CAMERA, **options})

    refused("no camera", camera=None)
    refused("no surface with a bake is in the picture", camera=Camera.look_at((0, 9, 0), (0, 20, 0), width=8, height=8))
    refused("no shape 'bowk'.*Did you mean 'bowl'", {"bowk": matte})
    refused("unknown lookup", lookup="pixl")
    refused("7 buffers are too few", buffers=7)
    refused("no method given", methods=[])
    spectral = SimpleNamespace(**{name: getattr(matte, name) for name in ("path", "manifest")}, rendering="spectral")
    monkey = {"*": spectral}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "opened", lambda bake: bake)
        refused("was rendered in spectral, and objects are path-traced in RGB", monkey)


def test_the_time_of_preparation_counts_the_occlusion_which_is_made_once(matte, scene, monkeypatch):
    """It is made for the first picture of a renderer; the one that is kept is the second."""
    made, of = [], Occlusion.of

    def slow(*given, **options):
        made.append(of(*given, **options))
        time.sleep(0.4)
        return made[-1]

    monkeypatch.setattr(Occlusion, "of", slow)
    renderers = module._renderers(scene, {"*": matte}, "rsibr", "pixel", "on")
    assert renderers[0].methods[0] is renderers[1].methods[0]
    primary = SimpleNamespace(camera=CAMERA, rays=1)
    assert module._picture(renderers[1], primary)[0].prepare_seconds > 0.4
    bare = module._picture(renderers[0], primary)[0]
    dark = renderers[1].picture(CAMERA, 1)
    assert len(made) == 1
    assert (bare.radiance - dark.radiance).max() > 0
