"""Lamps in a map: their energy and direction, against Mitsuba's own light."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.capture.lamps.hat import add_light, hat_integrals, radiance_integral, texel_centres
from rsibr.capture.lamps.lamp import Lamp, near_note, point_lamp
from rsibr.capture.synthetic.scenes import matte
from rsibr.errors import InputError
from tests.capture.balls.photographed import framed, photographed
from tests.capture.skies import of_image

POLES_AND_SEAM = [(0, 1, 0), (0, -1, 0), (1e-3, 1, 1e-3), (0, 0, -1), (-1e-4, 0.3, -1), (1e-4, 0.3, -1), (1, 2, 3)]


def fine_integral(image, power):
    """∫ L (cos γ)^power dω of the bilinear map, by a fine midpoint rule that knows nothing of hats; about all axes."""
    height, width = image.shape[:2]
    fine = 128 if height < 16 else 16
    v = (np.arange((height - 1) * fine) + 0.5) / fine
    u = (np.arange(width * fine) + 0.5) / fine - 0.5
    top, left = v.astype(int), np.floor(u).astype(int)
    down, across = (v - top)[:, None, None], (u - left)[None, :, None]
    left, right = left % width, (left + 1) % width
    rows = (1 - down) * image[top] + down * image[top + 1]
    value = (1 - across) * rows[:, left] + across * rows[:, right]
    theta, phi = np.pi * v / (height - 1), 2 * np.pi * (u + 0.5) / width
    weight = np.sin(theta)[:, None] * (np.pi / (height - 1) / fine) * (2 * np.pi / width / fine)
    direction = np.stack(
        np.broadcast_arrays(
            np.sin(theta)[:, None] * np.sin(phi), np.cos(theta)[:, None], -np.sin(theta)[:, None] * np.cos(phi)
        ),
        axis=-1,
    )
    energy = (value * weight[..., None]).sum(axis=(0, 1))
    return energy if power == 0 else (direction * (value.mean(axis=2) * weight)[..., None]).sum(axis=(0, 1))


@pytest.mark.parametrize("toward", POLES_AND_SEAM)
def test_energy_is_exact_everywhere(toward):
    """Target of the issue: below 1e-4, poles and the wrap included."""
    lit = Lamp(toward, (1.0, 2.0, 3.0)).added_to(np.zeros((9, 16, 3), np.float32))
    assert fine_integral(lit, 0) == pytest.approx([1, 2, 3], rel=1e-4)
    assert radiance_integral(lit, toward / np.linalg.norm(toward), np.pi) == pytest.approx([1, 2, 3], rel=1e-6)


@pytest.mark.parametrize("toward", POLES_AND_SEAM)
def test_the_direction_holds(toward):
    lit = Lamp(toward, (1.0, 1.0, 1.0)).added_to(np.zeros((65, 128, 3), np.float32))
    mean = fine_integral(lit, 1)
    error = np.degrees(np.arccos(mean @ toward / np.linalg.norm(mean) / np.linalg.norm(toward)))
    assert error < 0.1  # the nearest texel errs by up to 2°


def test_hats_cover_the_sphere():
    assert (hat_integrals(33, 64) * 64).sum() == pytest.approx(4 * np.pi, rel=1e-12)


def test_a_point_lamp_falls_off_with_the_square():
    assert point_lamp((0, 3, 4), (50, 100, 25)).irradiance == (2, 4, 1)
    assert near_note(29, 1) is not None
    assert near_note(60, 2) is None


def test_a_disc_lights_a_facing_surface_as_it_was_told():
    """A disc of 10° is seen from a matte plane at its normal, by the map's texels."""
    toward = np.array([0.2, 0.8, -0.4]) / np.linalg.norm([0.2, 0.8, -0.4])
    lit = Lamp(tuple(toward), (3.0, 2.0, 1.0), 10).added_to(np.zeros((129, 256, 3), np.float32))
    cosine = np.maximum(texel_centres(129, 256) @ toward, 0)
    found = (lit * (cosine * hat_integrals(129, 256)[:, None])[..., None]).sum(axis=(0, 1))
    assert found == pytest.approx([3, 2, 1], rel=2e-3)
    assert lit[texel_centres(129, 256) @ toward < np.cos(np.radians(13))].max() == 0


def test_a_matte_ball_looks_as_under_mitsubas_own_lamp():
    """A directional emitter of Mitsuba, of the same irradiance, on the same ball: an independent client."""
    from rsibr.capture.synthetic.rendering import rendered
    from rsibr.capture.synthetic.scenes import BALL

    toward, energy = np.array([0.6, 0.5, 0.62]), (4.0, 2.0, 1.0)
    lit = add_light(np.zeros((129, 256, 3), np.float32), toward / np.linalg.norm(toward), energy)
    camera = framed((0, 0, 1), 10, 48)
    ball, alpha = photographed(of_image(lit), matte(0.5), camera, samples=256)
    sun = {"type": "directional", "direction": (-toward).tolist(), "irradiance": {"type": "rgb", "value": list(energy)}}
    true, _ = rendered({BALL: {"type": "sphere", "bsdf": matte(0.5)}, "sun": sun}, camera, samples=64)
    inside = (alpha == 1) & (true.max(axis=2) > 0.05 * true.max())
    assert ball.image.radiance[inside].sum(axis=0) == pytest.approx(true[inside].sum(axis=0), rel=3e-3)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Lamp((0, 0, 0), (1, 1, 1)), "not all 0"),
        (lambda: Lamp((0, 1, 0), (1, -1, 1)), "0 or more"),
        (lambda: Lamp((0, 1, 0), (1, float("nan"), 1)), "0 or more"),
        (lambda: Lamp((0, 1, 0), (1, 1, 1), 90), "half angle"),
        (lambda: point_lamp((0, 0, 0), (1, 1, 1)), "object's centre"),
    ],
)
def test_mistakes_are_one_clear_line(make, says):
    with pytest.raises(InputError, match=says):
        make()


@pytest.mark.parametrize(("distance", "error"), [(3, 0.47), (10, 0.15), (30, 0.051), (100, 0.0155)])
def test_how_far_a_table_errs_for_a_near_lamp(rng, distance, error):
    """Irradiance of a sphere of radius 1 by a lamp at a place, and by the same lamp at infinity; as `NEAR` says."""
    n = rng.normal(size=(200_000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    toward = np.array([0.0, 0.0, distance]) - n
    size = np.linalg.norm(toward, axis=1)
    true = np.maximum((n * toward).sum(axis=1) / size, 0) / size**2
    table = np.maximum(n[:, 2], 0) / distance**2
    assert np.sqrt(((table - true) ** 2).mean() / (true**2).mean()) == pytest.approx(error, rel=0.02)
