"""The variant of Mitsuba is the user's: every public function leaves it as it was, and what was made earlier usable."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import rsibr
from rsibr import backend
from rsibr.errors import RsibrError
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from tests.cli.command import write_config

USERS = ("scalar_rgb", "llvm_ad_spectral")

STUDY = {
    "base": {
        "environment": {"emitter": {"type": "constant", "radiance": 0.5}},
        "material": {"preset": "matte-lambert"},
        "map": {"resolution": 8},
        "effects": {"view_dependence": "on"},
    },
    "method": ["nearest"],
    "sweep": [{"samples": [16]}],
    "judge": {"views": 1, "samples": 8, "repeats": 3},
    "path_tracing": {"samples": [4, 9, 16], "pass_samples": 4},
}


@pytest.fixture(autouse=True)
def _afterwards():
    """Leave the variant of all other tests."""
    yield
    backend.use()


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> tuple[Path, Path]:
    """Config, and a bake of it."""
    folder = tmp_path_factory.mktemp("variants")
    config = write_config(folder)
    return config, rsibr.bake(config, out=folder / "a.rsibr").path


def users_scene():
    """A scene of the user's in their own variant, and how it is rendered."""
    box = {"type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"}, "ball": {"type": "sphere"}}
    sensor = {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}}
    made, camera = mi.load_dict(box), mi.load_dict(sensor)
    return lambda: np.array(mi.render(made, sensor=camera, spp=4, seed=1))


def calls(config, bake, out):
    """Each public function, so that it works and so that it fails."""
    return {
        "bake": (lambda: rsibr.bake(config, out=out / "b.rsibr"), lambda: rsibr.bake(out / "absent.toml", out=out)),
        "plan": (lambda: rsibr.plan(config), lambda: rsibr.plan(config, overrides=["material.preset=no-such"])),
        "reconstruct": (lambda: rsibr.reconstruct(bake, (1, 2, 3)), lambda: rsibr.reconstruct(bake, (0, 0, 0))),
        "check": (lambda: rsibr.check(bake), lambda: rsibr.check(out / "absent.rsibr")),
        "validate": (
            lambda: rsibr.validate(bake, views=1, samples=8, methods=["nearest"]),
            lambda: rsibr.validate(bake, methods=["no-such"]),
        ),
        "study": (
            lambda: rsibr.study(STUDY, out=out / "study"),
            lambda: rsibr.study({**STUDY, "method": ["no-such"]}, out=out),
        ),
    }


@pytest.mark.parametrize("users", USERS)
def test_every_public_function_leaves_the_users_variant(users, scene, tmp_path):
    mi.set_variant(users)
    render = users_scene()
    image = render()
    for name, (works, fails) in calls(*scene, tmp_path).items():
        if users == USERS[0] or name in ("reconstruct", "check"):  # the others take seconds
            works()
            assert mi.variant() == users, name
        with pytest.raises(RsibrError):
            fails()
        assert mi.variant() == users, name
    np.testing.assert_array_equal(render(), image)  # a scene that was made before
    np.testing.assert_array_equal(users_scene()(), image)  # and one made afterwards


def test_what_rsibr_made_earlier_works_in_any_variant(scene):
    opened = rsibr.open_bake(scene[1])
    maps = [rsibr.reconstruct(opened, (1, 2, 3)).image]
    for users in USERS:
        mi.set_variant(users)
        maps.append(rsibr.reconstruct(opened, (1, 2, 3)).image)
        assert mi.variant() == users
    np.testing.assert_array_equal(maps[0], maps[1])
    np.testing.assert_array_equal(maps[0], maps[2])


@pytest.mark.parametrize("name", ["nearest", "cabral1999", "rsibr"])
def test_a_method_made_earlier_works_in_any_variant(name, scene):
    """Its map and its lookup, made ready in one variant of the user's and used in the others."""
    normals, view = np.eye(3, dtype=np.float32), np.array([0.6, 0.0, 0.8], dtype=np.float32)
    n, v = mi.Vector3f(normals), mi.Vector3f(view)
    frame = view_frame(view.astype(np.float64))
    mi.set_variant(USERS[0])
    method = MethodSet(rsibr.open_bake(scene[1]))[name]
    found = [(np.array(method.map(frame, 8)), np.array(method.eval(n, v)))]
    for users in (*USERS, "llvm_ad_rgb"):
        mi.set_variant(users)
        found.append((np.array(method.map(frame, 8)), np.array(method.eval(n, v))))
        assert mi.variant() == users
    for image, values in found[1:]:
        np.testing.assert_array_equal(image, found[0][0])
        np.testing.assert_array_equal(values, found[0][1])
    assert np.isfinite(found[0][1]).all()


FRESH = """
import mitsuba as mi, rsibr, sys, json
variants = [mi.variant()]
rsibr.reconstruct(sys.argv[1], (1, 2, 3))
variants.append(mi.variant())
mi.set_variant("scalar_rgb")
scene = mi.load_dict(mi.cornell_box())
rsibr.reconstruct(sys.argv[1], (1, 2, 3))
variants.append(mi.variant())
mi.load_dict(mi.cornell_box())
picture = mi.render(scene, spp=1)
print(json.dumps(variants))
"""


def test_without_a_variant_rsibrs_rgb_stays_and_the_user_can_set_theirs(scene):
    """Mitsuba cannot go back to none."""
    done = subprocess.run(
        [sys.executable, "-c", FRESH, str(scene[1])], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == [None, backend.use(), "scalar_rgb"]
