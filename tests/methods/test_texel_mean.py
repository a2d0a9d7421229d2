"""Means along the radius of a texel against closed forms: 1, the radius and the height over its part inside."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.sphere_map import covered_middle, normal_from_disk, texel_centres
from rsibr.methods.texel_mean import radial_mean
from tests.arrays import disk_grid, to_numpy, vector

N = 24
STEP = 2 / N


def along_radius(n):
    return mi.Color3f(1, dr.sqrt(n.x * n.x + n.y * n.y), n.z)


def normals(radii, turn=0.7):
    radii = np.asarray(radii)
    return np.stack([radii * np.cos(turn), radii * np.sin(turn), np.sqrt(1 - radii**2)], axis=1)


def mean(radii, points, seen=along_radius):
    found = radial_mean(vector(normals(radii)), mi.Float(STEP), mi.UInt32(points), seen)
    return to_numpy(found)


def test_a_single_point_is_that_point_exactly(rng):
    """Bit for bit, the height too, which a radius in single precision does not hold at the rim."""
    n = vector(normals(np.concatenate([[0.0, 0.999999], rng.uniform(0, 1, 500)])))
    found = radial_mean(n, mi.Float(STEP), mi.UInt32(1), lambda m: mi.Color3f(m.x, m.y, m.z))
    assert np.array_equal(to_numpy(found), to_numpy(n))


@pytest.mark.parametrize("points", [2, 4])
def test_a_whole_texel_is_a_mean_over_its_width(points):
    """A radius is linear: its mean is that of the middle. That of its square is r² + (1 − 1/points²) s²/12."""
    radii = np.linspace(0.1, 1 - STEP / 2 - 1e-4, 50)
    one, radius, _ = mean(radii, points)
    assert one == pytest.approx(np.ones(50), rel=1e-6)
    assert radius == pytest.approx(radii, rel=1e-5)
    squares = mean(radii, points, lambda n: mi.Color3f(n.x * n.x + n.y * n.y))[0]
    assert squares - radii**2 == pytest.approx(np.full(50, (1 - 1 / points**2) * STEP**2 / 12), rel=0.01)


def test_a_texel_that_the_rim_cuts_is_a_mean_over_its_part_inside():
    """From the middle of that part it reaches as far to the rim as inward: heights of √(1 − r²) by quadrature."""
    radii = np.linspace(1 - STEP / 2 + 1e-3, 1 - 1e-3, 20)
    _, radius, height = mean(radii, 64)
    assert radius == pytest.approx(radii, rel=1e-5)
    for middle, found in zip(radii, height, strict=True):
        r = middle + (1 - middle) * (2 * (np.arange(4000) + 0.5) / 4000 - 1)
        assert found == pytest.approx(np.sqrt(1 - r**2).mean(), rel=0.01)


def test_no_point_lies_beyond_the_rim_or_is_undefined():
    """For the middles of all texels that a map covers: normals of unit length, heights not negative."""
    n = normal_from_disk(covered_middle(texel_centres(N), N))

    def checked(m):
        return mi.Color3f(dr.squared_norm(m), dr.select(m.z >= 0, 1.0, 0.0), m.z)

    length, above, height = to_numpy(radial_mean(n, mi.Float(STEP), mi.UInt32(4), checked))
    covered = (np.hypot(*disk_grid(N)) < 1).ravel()
    assert length[covered] == pytest.approx(np.ones(covered.sum()), abs=2e-6)
    assert (above == 1).all()
    assert np.isfinite(height).all()


def test_points_may_differ_from_texel_to_texel():
    radii, points = [0.3, 0.6, 0.9], np.array([1, 2, 4], dtype=np.uint32)
    n = vector(normals(radii))
    together = to_numpy(radial_mean(n, mi.Float(STEP), mi.UInt32(points), along_radius))
    apart = [mean([r], int(k))[:, 0] for r, k in zip(radii, points, strict=True)]
    assert pytest.approx(np.array(apart), rel=1e-6) == together.T
