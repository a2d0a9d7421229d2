"""The renderer does what its plan says, and says what it left out."""

import numpy as np
import pytest
import trimesh

from rsibr.baking.baker import bake
from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.renderer import ObjectRenderer
from tests.shading.occlusion.objects import scene_of, torus

CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "matte-lambert"
[map]
resolution = 32
[sampling]
samples = 16
"""


@pytest.fixture(autouse=True, scope="module")
def _few_points():
    """Fewer points than a picture needs: they cost the time of these tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rsibr.shading.occlusion.surface_points.MOST_REFINED", 2**13)
        yield


@pytest.fixture(scope="module")
def matte_bake(tmp_path_factory, gradient_sky):
    """Bake of a matte material: one map, for its light has a closed form."""
    folder = tmp_path_factory.mktemp("matte")
    (folder / "matte.toml").write_text(CONFIG.format(environment=gradient_sky))
    return bake(folder / "matte.toml", out=folder / "matte.rsibr")


@pytest.fixture(scope="module")
def ring(matte_bake):
    """A torus, its bake, and a camera that looks into it."""
    scene = scene_of(ring=torus())
    return scene, {"*": matte_bake}, Camera.look_at((0, 2.5, 3.5), (0, 0, 0), width=24, height=16)


def test_the_plan_is_followed_and_told(ring):
    scene, bakes, camera = ring
    auto = ObjectRenderer(scene, bakes)
    assert auto.plan["self_occlusion"].on
    shaded = auto.picture(camera, 4)
    assert not shaded.notes
    opened = ObjectRenderer(scene, bakes, occlusion="off").picture(camera, 4)
    covered = shaded.alpha == 1
    assert (shaded.radiance[covered] <= opened.radiance[covered] * 1.01).all()
    assert (shaded.radiance[covered] / opened.radiance[covered]).min() < 0.9
    assert [note.split()[0] for note in opened.notes] == ["self_occlusion:", "interreflection:"]
    dark = ObjectRenderer(scene, bakes, effects={"interreflection": "off"}).picture(camera, 4)
    assert dark.radiance[covered].mean() < shaded.radiance[covered].mean()
    assert auto.plan["back_facing"].why.startswith("0 replaced")


def test_convex_objects_are_left_open_and_effects_are_forced(ring):
    _, bakes, camera = ring
    ball = scene_of(ball=trimesh.creation.icosphere(3))
    auto, forced = (
        ObjectRenderer(ball, bakes),
        ObjectRenderer(ball, bakes, occlusion="on", effects={"silhouettes": "off"}),
    )
    first, second = auto.picture(camera, 1), forced.picture(camera, 4)
    assert not auto.plan["self_occlusion"].on
    assert forced.plan["self_occlusion"].on
    assert not forced.plan["silhouettes"].on
    assert np.allclose(first.radiance, second.radiance, rtol=0.01)


def test_a_far_camera_needs_one_map(ring):
    scene, bakes, _ = ring
    renderer = ObjectRenderer(scene, bakes, lookup="auto", occlusion="off")
    far = Camera.look_at((0, 0, 300), (0, 0, 0), fov_deg=1, width=8, height=8)
    assert not renderer.plan_of(far)["perspective"].on
    assert renderer.picture(far, 1).alpha.any()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"occlusion": "yes"}, "occlusion: 'yes'"),
        ({"lookup": "pixl"}, "pixel"),
        ({"effects": {"gliter": "on"}}, "gliter"),
    ],
)
def test_wrong_options_are_one_line(options, says, ring):
    scene, bakes, _ = ring
    with pytest.raises(InputError, match=says):
        ObjectRenderer(scene, bakes, **options)
