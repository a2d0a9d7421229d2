"""Outlines of a sphere: the cone that was photographed comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.silhouette.cone import Cone, fitted_cone
from rsibr.capture.silhouette.found import found_cone
from rsibr.capture.silhouette.marks import circle_places, mask_places
from rsibr.capture.synthetic.scenes import matte, mirror
from rsibr.errors import InputError
from tests.capture.balls.photographed import framed, photographed
from tests.capture.skies import courtyard


@pytest.fixture
def camera():
    """Off the axis, and not square."""
    own = Pinhole.looking((1, 2, 9), (1.2, 0.1, 0), fov_deg=35, width=300, height=200)
    return replace(own, principal=np.array([140.0, 104.0]))


@pytest.mark.parametrize("distance", [1.5, 5.0, 50.0])
def test_a_cone_comes_back_from_its_rim(camera, distance):
    axis = camera.axes @ np.array([0.1, -0.05, 1.0])
    axis /= np.linalg.norm(axis)
    found = fitted_cone(camera, Cone(axis, distance, 0.0).rim(camera))
    assert found.distance == pytest.approx(distance, rel=1e-9)
    assert np.abs(found.axis - axis).max() < 1e-9
    assert found.residual < 1e-7


def test_a_rendered_mask_gives_the_camera_back():
    camera = framed((1, 1, 2), 8, 200, (0.5, 0.2))
    _, alpha = photographed(courtyard(), matte(), camera, samples=64)
    found = fitted_cone(camera, mask_places(alpha))
    assert found.distance == pytest.approx(8, rel=2e-3)
    expected = -camera.position / np.linalg.norm(camera.position)
    assert np.degrees(np.arccos(found.axis @ expected)) < 0.02


def test_the_rim_touches_the_sphere():
    """Each ray of the rim passes the centre at one radius."""
    cone = Cone(np.array([0.0, 0.0, -1.0]), 4.0, 0.0)
    camera = Pinhole.looking((0, 0, 4), (0, 0, 0), fov_deg=50, width=64, height=64)
    rays = camera.directions(cone.rim(camera))
    assert np.allclose(np.linalg.norm(np.cross(rays, camera.position), axis=1), 1)


@pytest.mark.slow
@pytest.mark.parametrize("bsdf", [matte(), mirror()], ids=["matte", "mirror"])
def test_an_unmarked_ball_is_found_or_refused(bsdf):
    """Within a pixel; a ball that cannot be told from its surroundings is one clear line, never a wrong outline."""
    camera = framed((1, 0.4, 2), 10, 240)
    ball, _ = photographed(courtyard(), bsdf, camera)
    try:
        found = found_cone(camera, np.clip(ball.image.radiance, 0, 1) ** 0.45, "ball.png")
    except InputError as error:
        assert "--circle or a --mask" in str(error)  # noqa: PT017
        return
    assert np.abs(found.rim(camera) - Cone(-ball.view, 10.0, 0.0).rim(camera)).max() < 4


def test_a_picture_without_a_ball_is_refused(rng):
    camera = framed((0, 0, 1), 10, 96)
    with pytest.raises(InputError, match="no outline of a sphere"):
        found_cone(camera, rng.random((96, 96, 3)).repeat(1, 0), "noise.png")
    with pytest.raises(InputError, match="no outline of a sphere"):
        found_cone(camera, np.full((96, 96, 3), 0.5), "grey.png")


def test_marks(camera):
    assert np.hypot(*(circle_places(10, 20, 5) - (10, 20)).T) == pytest.approx(np.full(256, 5))
    with pytest.raises(InputError, match="radius"):
        circle_places(1, 1, 0)
    with pytest.raises(InputError, match="no outline"):
        mask_places(np.ones((4, 4)))
    with pytest.raises(InputError, match="3 places"):
        fitted_cone(camera, np.zeros((3, 2)))
    with pytest.raises(InputError, match="no outline of a sphere"):
        fitted_cone(camera, np.stack([np.arange(9.0), np.arange(9.0)], axis=1))
