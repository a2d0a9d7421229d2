"""The environment: where its light comes from, what it refuses, and the hard cases of its texels and sizes."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import Environment, load_environment
from tests.scene.maps import BLOBS, write_exr

SKY = {"type": "sunsky", "turbidity": 3.0, "sun_scale": 0.0}
Y_QUARTER_TURN = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # +Z to +X


def radiance(environment: Environment, directions: np.ndarray) -> np.ndarray:
    """Radiance (N, 3) that arrives from the directions (N, 3)."""
    (emitter,) = mi.load_dict({"type": "scene", "emitter": environment.emitter()}).emitters()
    si = dr.zeros(mi.SurfaceInteraction3f, len(directions))
    si.wi = -mi.Vector3f(np.asarray(directions, dtype=np.float32).T)
    return np.array(emitter.eval(si)).T


def from_emitter(emitter: dict, **keys: float) -> Environment:
    return load_environment(EnvironmentConfig(emitter=emitter, **keys))


def refusal(**keys: object) -> str:
    with pytest.raises(InputError) as caught:
        load_environment(EnvironmentConfig(**keys))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def sphere(n: int = 500) -> np.ndarray:
    directions = np.random.default_rng(3).normal(size=(n, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_lights_are_where_they_should_be(asymmetric_environment, turns):
    environment = load_environment(EnvironmentConfig(file=asymmetric_environment, rotation_deg=90.0 * turns))
    turned = [np.linalg.matrix_power(Y_QUARTER_TURN, turns) @ axis for axis in BLOBS]
    np.testing.assert_allclose(
        radiance(environment, np.array(turned)), np.array(list(BLOBS.values())) + 0.05, rtol=0.03
    )


def test_a_bright_texel_shows_in_its_direction(tmp_path):
    image = np.zeros((16, 32, 3))
    image[8, 7] = 5.0  # u = 7.5/32, v = 8/15
    environment = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "a.exr", image)))
    phi, theta = 2.0 * np.pi * 7.5 / 32, np.pi * 8 / 15
    direction = np.array([[np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)]])
    np.testing.assert_allclose(radiance(environment, direction), 5.0, rtol=1e-3)
    assert direction[0, 0] > 0.9  # near +X
    np.testing.assert_array_equal(radiance(environment, -direction), 0.0)


def test_gradient_sky_is_what_it_says(gradient_sky, gradient_axis):
    environment = load_environment(EnvironmentConfig(file=gradient_sky, scale=2.0))
    expected = 2.0 * (1.0 + sphere() @ gradient_axis)
    np.testing.assert_allclose(radiance(environment, sphere()), expected[:, None].repeat(3, axis=1), atol=1e-4)


def test_hc26_negatives_are_clipped_counted_and_reported(tmp_path):
    image = np.ones((4, 8, 3))
    image[1, 2] = (-0.25, 1.0, -0.5)
    environment = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "a.exr", image), scale=3.0))
    assert (environment.clipped, environment.lowest) == (2, -0.5)
    assert environment.image is not None
    np.testing.assert_array_equal(environment.image[1, 2], [0.0, 3.0, 0.0])


def test_hc27_black_environment_has_a_finite_density(tmp_path):
    environment = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "a.exr", np.zeros((4, 8, 3)))))
    (emitter,) = mi.load_dict({"type": "scene", "emitter": environment.emitter()}).emitters()
    sample = dr.zeros(mi.DirectionSample3f)
    sample.d = mi.Vector3f(0, 0, 1)
    assert np.isfinite(np.array(emitter.pdf_direction(dr.zeros(mi.Interaction3f), sample))).all()
    np.testing.assert_array_equal(radiance(environment, sphere()), 0.0)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (2, 2), (3, 5), (64, 1), (2, 16384)])
def test_hc29_any_size_integrates_to_what_it_shows(tmp_path, shape):
    """Emitter sampling against uniform sampling; 5σ on both, false alarms below 1e-6 a shape."""
    image = 0.1 + np.random.default_rng(1).random((*shape, 3))
    environment = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "a.exr", image)))
    (emitter,) = mi.load_dict({"type": "scene", "emitter": environment.emitter()}).emitters()
    n = 1 << 16
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(5, n)
    _, weight = emitter.sample_direction(dr.zeros(mi.Interaction3f, n), sampler.next_2d())
    drawn = np.array(weight).T.astype(np.float64)
    uniform = 4.0 * np.pi * radiance(environment, np.array(mi.warp.square_to_uniform_sphere(sampler.next_2d())).T)
    error = np.sqrt((drawn.var(axis=0) + uniform.astype(np.float64).var(axis=0)) / n) + 1e-5
    assert (np.abs(drawn.mean(axis=0) - uniform.mean(axis=0)) < 5.0 * error).all()


def test_only_the_pole_row_lit_is_refused(tmp_path):
    image = np.zeros((4, 8, 3))
    image[0] = 1.0
    assert "only its first row has light" in refusal(file=write_exr(tmp_path / "a.exr", image))


def test_hc24_sun_over_a_dim_sky_stays_exact(tmp_path):
    image = np.full((32, 64, 3), 1e-2)
    image[8, 20] = 1e6
    environment = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "a.exr", image)))
    assert environment.image is not None
    assert environment.image.max() == np.float32(1e6)


@pytest.mark.parametrize("scale", [1e37, 1e39])
def test_a_sum_beyond_float32_is_refused(tmp_path, scale):
    path = write_exr(tmp_path / "a.exr", np.ones((16, 32, 3)))
    text = refusal(file=path, scale=scale)
    assert "sum" in text
    assert text.endswith("Lower the scale")


def test_digest_knows_content_rotation_and_scale_but_not_names(tmp_path):
    image = np.random.default_rng(2).random((4, 8, 3))
    a, b = write_exr(tmp_path / "a.exr", image), write_exr(tmp_path / "b.exr", image)
    digest = load_environment(EnvironmentConfig(file=a)).digest
    assert load_environment(EnvironmentConfig(file=b)).digest == digest
    assert load_environment(EnvironmentConfig(file=a, rotation_deg=360.0)).digest == digest
    assert from_emitter({"type": "envmap", "filename": str(a)}).digest == digest
    image[2, 3, 1] += 1e-3
    others = [
        load_environment(EnvironmentConfig(file=a, rotation_deg=1.0)).digest,
        load_environment(EnvironmentConfig(file=a, scale=2.0)).digest,
        load_environment(EnvironmentConfig(file=write_exr(tmp_path / "c.exr", image))).digest,
        from_emitter({"type": "constant"}).digest,
        from_emitter({"type": "constant", "radiance": 2.0}).digest,
    ]
    assert len({digest, *others}) == 6


def test_envmap_dict_is_checked_as_a_file_is(tmp_path):
    image = np.ones((4, 8, 3))
    path = write_exr(tmp_path / "a.exr", image)
    environment = from_emitter({"type": "envmap", "filename": str(path), "scale": 2.0}, scale=3.0)
    np.testing.assert_allclose(radiance(environment, sphere()), 6.0, rtol=1e-6)
    image[3, 4, 2] = np.nan
    write_exr(path, image)
    assert "texel (row 3, column 4) is NaN" in refusal(emitter={"type": "envmap", "filename": str(path)})


def test_a_sky_stands_upright():
    light, height = radiance(from_emitter(SKY), sphere()), sphere()[:, 1]
    assert light[height < -0.05].max() == 0.0
    assert light[height > 0.05].min() > 0.0


@pytest.mark.parametrize(
    "emitter",
    [
        SKY,
        {**SKY, "sun_direction": [0.48, 0.64, 0.6]},
        {**SKY, "to_world": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
        {"type": "sunsky", "sky_scale": 0.0, "sun_aperture": 20.0, "sun_direction": [0.48, 0.64, 0.6]},
    ],
)
def test_rotation_turns_a_sky(emitter):
    turned = from_emitter(emitter, rotation_deg=90.0)
    expected = radiance(from_emitter(emitter), sphere())
    assert expected.max() > 0.0
    np.testing.assert_allclose(radiance(turned, sphere() @ Y_QUARTER_TURN.T), expected, rtol=2e-3, atol=1e-4)


def test_rotation_turns_a_directional_light():
    emitter = from_emitter({"type": "directional", "direction": [0.0, -0.6, -0.8]}, rotation_deg=90.0).emitter()
    np.testing.assert_allclose(emitter["direction"], [-0.8, -0.6, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "emitter",
    [
        SKY,
        {"type": "constant"},
        {"type": "constant", "radiance": 0.5},
        {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 2.0, 3.0]}},
    ],
)
def test_scale_multiplies_the_radiance(emitter):
    expected = 2.5 * radiance(from_emitter(emitter), sphere())
    np.testing.assert_allclose(radiance(from_emitter(emitter, scale=2.5), sphere()), expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("emitter", "scale", "parts"),
    [
        ({"type": "nosuch"}, 1.0, ['"nosuch"', "not found"]),
        ({"type": "sunsky", "foo": 3}, 1.0, ['"sunsky"', '"foo"']),
        ({"type": "sunsky", "turbidity": 300.0}, 1.0, ["Turbidity", "[1, 10]"]),
        ({"type": "point"}, 1.0, ["point is no emitter at infinity", "Use envmap, constant"]),
        ({"type": "diffuse"}, 1.0, ["diffuse is no emitter at infinity"]),
        ({"type": "sphere", "e": {"type": "area"}}, 1.0, ["no emitter at infinity"]),
        ({"type": "point"}, 2.0, ["environment.scale", "'point'"]),
        ({"type": "constant", "radiance": {"type": "d65"}}, 2.0, ["environment.scale", "radiance"]),
        ({"type": "constant", "radiance": [1.0, 2.0, 3.0]}, 1.0, ["Write a colour as {type = 'rgb'"]),
        ({"type": "constant", "radiance": -1.0}, 1.0, ["negative"]),
        ({"type": "envmap"}, 1.0, ["filename"]),
        ({"type": "envmap", "filename": "/none.exr"}, 1.0, ["/none.exr", "no such environment map"]),
        ({"type": "sunsky", "albedo": {"type": "bitmap", "filename": "/none.png"}}, 1.0, ["no file /none.png"]),
        ({"type": "sunsky", "to_world": [[1, 0], [0, 1]]}, 1.0, ["environment.emitter.to_world", "four rows"]),
        ({"type": "sunsky", "sun_direction": "up"}, 1.0, ["environment.emitter.sun_direction", "[x, y, z]"]),
    ],
)
def test_an_emitter_that_cannot_be_used(emitter, scale, parts):
    text = refusal(emitter=emitter, scale=scale)
    for part in parts:
        assert part in text
