"""Mean of a delta lobe over texels against closed forms: an even sky and an albedo of cos² θ = 1 − x² − y²."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.methods.rsibr.delta_lobe import DeltaLobe
from tests.arrays import to_numpy, vector

N = 24
STEP = 2 / N


@pytest.fixture(scope="module")
def texels():
    """Indices and lower left corners of all texels with coverage, and a normal somewhere in each."""
    coverage = texel_coverage(N)
    row, column = np.nonzero(coverage > 0.05)
    corner = np.stack([column * STEP - 1, 1 - (row + 1) * STEP], axis=1)
    inward = (corner < -STEP / 2) * 0.98 + 0.01  # the point of a texel that is nearly the nearest to the centre
    p = corner + inward * STEP
    normals = np.concatenate([p, np.sqrt(1 - (p**2).sum(axis=1, keepdims=True))], axis=1)
    return coverage[row, column], corner, normals


def mean_over(normals):
    image = np.full((256, 256, 3), 3.0, np.float32)
    lobe = DeltaLobe.of(Light(image), EnvironmentPyramid.finest_only(image))
    frame = mi.Matrix3f(np.eye(3, dtype=np.float32))
    found = lobe.mean_over_texel(vector(normals), frame, mi.Float(STEP), lambda cosine: mi.Color3f(cosine * cosine))
    return to_numpy(found)[1] / 3.0


def test_a_whole_texel_is_its_integral(texels):
    """Over [x, x + s] the mean of x² is x² + x s + s²/3."""
    coverage, corner, normals = texels
    whole = coverage == 1
    expected = 1 - (corner**2 + corner * STEP + STEP**2 / 3).sum(axis=1)
    assert np.abs(mean_over(normals) - expected)[whole].max() < 2e-4


def test_a_texel_at_the_rim_is_the_integral_over_its_part_inside(texels):
    """By 200² points of each; outside the disk there is no surface."""
    coverage, corner, normals = texels
    cut = coverage < 1
    places = (np.arange(200) + 0.5) * STEP / 200
    x, y = (corner[cut, axis, None] + places for axis in (0, 1))
    height = 1 - x[:, :, None] ** 2 - y[:, None, :] ** 2
    expected = np.maximum(height, 0).sum(axis=(1, 2)) / (height > 0).sum(axis=(1, 2))
    error = mean_over(normals)[cut] / expected - 1
    assert np.abs(error).mean() < 0.03
    assert abs(error.mean()) < 0.02
