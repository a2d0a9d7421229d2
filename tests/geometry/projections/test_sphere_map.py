"""Parameterisation of the sphere map: inverses, area, singularity, coverage."""

import numpy as np
import pytest

from rsibr.geometry.projections.sphere_map import (
    covered_middle,
    disk_from_normal,
    disk_from_reflection,
    normal_from_disk,
    reflection_from_disk,
    texel_centres,
    texel_coverage,
    tiled_texels,
)
from tests.arrays import disk_grid, point, to_numpy, unit_vectors, vector


def disk_points(rng, count, radius=1.0):
    angle, r = rng.uniform(0, 2 * np.pi, count), radius * np.sqrt(rng.uniform(0, 1, count))
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


def test_normals_are_unit_and_invert(rng):
    p = disk_points(rng, 10_000)
    n = to_numpy(normal_from_disk(point(p)))
    assert np.abs(np.linalg.norm(n, axis=0) - 1).max() < 3e-7
    assert np.abs(to_numpy(disk_from_normal(vector(n.T))).T - p).max() < 2e-7


def test_reflection_is_the_mirror_image_of_the_view(rng):
    p = disk_points(rng, 10_000)
    n = to_numpy(normal_from_disk(point(p)))
    view = np.array([0.0, 0.0, 1.0])
    assert np.abs(to_numpy(reflection_from_disk(point(p))) - (2 * n[2] * n - view[:, None])).max() < 1e-6


def test_reflection_inverts_up_to_its_singularity(rng):
    p = disk_points(rng, 10_000, radius=0.999)
    back = to_numpy(disk_from_reflection(reflection_from_disk(point(p)))).T
    assert np.abs(back - p).max() < 2e-5  # the map is stretched 1/cos²θ: at radius .999 an ulp of r is 500 of p
    assert np.abs(back - p)[np.hypot(*p.T) < 0.9].max() < 1e-6


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-5, 1e-3, 1e-1])
def test_reflection_inverse_is_finite_at_and_near_the_singularity(angle):
    p = to_numpy(disk_from_reflection(vector([[np.sin(angle), 0.0, -np.cos(angle)]])))
    assert np.isfinite(p).all()
    assert np.linalg.norm(p) <= 1 + 1e-6
    if angle > 1e-6:
        assert p[0, 0] == pytest.approx(np.cos(angle / 2), abs=1e-6)


def test_points_outside_the_disk_are_taken_to_the_rim():
    n = to_numpy(normal_from_disk(point([[1.0, 0.0], [1.0, 1.0], [0.0, -3.0]])))
    assert np.isfinite(n).all()
    assert np.allclose(n, np.array([[1, 0, 0], [0.5**0.5, 0.5**0.5, 0], [0, -1, 0]]).T, atol=5e-4)  # √(1 − 1 + ulp)


def test_normals_that_face_away_are_taken_to_the_rim(rng):
    n = unit_vectors(rng, 1000)
    n[:, 2] = -np.abs(n[:, 2])
    p = to_numpy(disk_from_normal(vector(n)))
    assert np.abs(np.linalg.norm(p, axis=0) - 1).max() < 3e-7


def test_texel_centres_start_at_the_top_left():
    x, y = disk_grid(7)
    centres = to_numpy(texel_centres(7))
    assert np.abs(centres - np.stack([x.ravel(), y.ravel()])).max() < 1e-6
    assert centres[:, 0] == pytest.approx([-6 / 7, 6 / 7], abs=1e-6)


@pytest.mark.parametrize("resolution", [1, 8, 16, 33, 64])
def test_tiles_hold_every_texel(resolution):
    assert set(np.array(tiled_texels(resolution)).tolist()) == set(range(resolution**2))


@pytest.mark.parametrize("resolution", [1, 2, 3, 8, 33, 256])
def test_coverage_sums_to_the_disk(resolution):
    coverage = texel_coverage(resolution)
    assert coverage.sum() * 4 / resolution**2 == pytest.approx(np.pi, abs=1e-12)
    assert coverage.min() >= 0
    assert coverage.max() <= 1


def test_coverage_of_a_texel_is_its_area_in_the_disk():
    resolution, fine = 16, 64
    x, y = disk_grid(resolution * fine)
    counted = (np.hypot(x, y) < 1).reshape(resolution, fine, resolution, fine).mean(axis=(1, 3))
    assert np.abs(texel_coverage(resolution) - counted).max() < 2 / fine


def test_mirror_map_is_equal_area_with_jacobian_four():
    """Hard case 14: Σ 4 dA over the disk is the whole sphere of reflection directions."""
    n = 256
    assert 4 * texel_coverage(n).sum() * (2 / n) ** 2 == pytest.approx(4 * np.pi, rel=5e-3)
    p, step = np.array([[0.3, -0.5]]), 1e-2
    corners = to_numpy(reflection_from_disk(point(p + np.array([[0, 0], [step, 0], [0, step]])))).T
    area = np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    assert area / step**2 == pytest.approx(4, rel=0.03)


@pytest.mark.parametrize("resolution", [16, 64])
def test_a_texel_cut_by_the_rim_shows_the_middle_of_what_is_left(resolution):
    """Against the mean over the covered part by brute force; whole texels show their centre."""
    x, y = disk_grid(resolution)
    step = ((np.arange(64) + 0.5) / 64 - 0.5) * 2 / resolution
    centres = texel_centres(resolution)
    found, centre = to_numpy(covered_middle(centres, resolution)).T, np.stack([x.ravel(), y.ravel()], axis=1)
    covered = texel_coverage(resolution).ravel()
    whole = np.hypot(*centre.T) < 1 - 1.5 / resolution
    assert np.array_equal(found[whole], to_numpy(centres).T[whole])
    for index in np.flatnonzero((covered >= 0.5) & (covered < 1)):
        inner = (centre[index] + np.stack(np.meshgrid(step, step), axis=-1)).reshape(-1, 2)
        radius = np.hypot(*inner.T)
        assert np.hypot(*found[index]) == pytest.approx(radius[radius < 1].mean(), abs=0.35 / resolution)
        assert np.hypot(*found[index]) <= 1
