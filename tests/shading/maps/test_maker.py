from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import stored_coverage
from rsibr.shading.maps.maker import MapMaker
from tests.arrays import disk_grid
from tests.shading.analytic import Method, constant

FRAMES = [view_frame(v) for v in ([0, 0, 1], [1, 0.5, 0.3])]


def levels(maps, count, resolution):
    """Texels of each level with the border, (count, N + 2, N + 2, 4)."""
    flat, found = np.array(maps.texels).reshape(count, -1, 4), []
    first = [*np.array(maps.first), flat.shape[1]]
    for k, (start, end) in enumerate(pairwise(first)):
        side = (resolution >> k) + 2
        found.append(flat[:, start:end].reshape(count, side, side, 4))
    return found


def waves():
    return Method(lambda n, v: mi.Color3f(2 + dr.sin(9 * n.x), 2 + dr.sin(7 * n.y + 1), 2 + dr.sin(8 * n.z)))


def test_a_constant_map_is_constant_on_all_levels_and_beyond_the_rim():
    made = levels(MapMaker(constant(), 32, has_levels=True).maps(FRAMES), 2, 32)
    assert [len(level[0]) - 2 for level in made] == [32, 16, 8, 4, 2, 1]
    for level in made:
        assert np.allclose(level[..., :3], [0.25, 0.5, 1.0], rtol=1e-6)


def test_levels_keep_the_energy_inside_the_disk():
    """Sum of radiance × area is the same on all levels: nothing from beyond the rim enters, nothing is lost."""
    made = levels(MapMaker(waves(), 64, has_levels=True).maps(FRAMES), 2, 64)
    reference = None
    for level in made:
        inner = level[:, 1:-1, 1:-1].astype(np.float64)
        energy = (inner[..., :3] * inner[..., 3:]).sum(axis=(1, 2)) / inner[..., 3].sum(axis=(1, 2))[:, None]
        reference = energy if reference is None else reference
        assert np.allclose(energy, reference, rtol=2e-4)
    assert abs(reference[0] - reference[1]).max() > 0.01  # two views, two maps


def test_level_zero_holds_the_radiance_of_its_texels():
    made = levels(MapMaker(waves(), 32).maps(FRAMES), 2, 32)
    assert len(made) == 1
    x, y = disk_grid(32)
    inside = np.hypot(x, y) < 1 - 2 / 32
    local = np.stack([x, y, np.sqrt(np.maximum(0, 1 - x * x - y * y))], axis=-1)
    for frame, level in zip(FRAMES, made[0], strict=True):
        n = local @ frame.T
        exact = np.stack([2 + np.sin(9 * n[..., 0]), 2 + np.sin(7 * n[..., 1] + 1), 2 + np.sin(8 * n[..., 2])], axis=-1)
        assert np.allclose(level[1:-1, 1:-1, :3][inside], exact[inside], atol=1e-4)
        assert np.allclose(level[1:-1, 1:-1, 3], stored_coverage(32), atol=1e-6)
        assert not level[0, :, 3].any()


def test_a_texel_of_the_next_level_is_the_mean_of_four():
    made = levels(MapMaker(waves(), 32, has_levels=True).maps(FRAMES[:1]), 1, 32)
    fine, coarse = made[0][0, 1:-1, 1:-1, :3], made[1][0, 1:-1, 1:-1, :3]
    mean = fine.reshape(16, 2, 16, 2, 3).mean(axis=(1, 3))
    assert np.allclose(coarse[5:11, 5:11], mean[5:11, 5:11], rtol=1e-5)


@pytest.mark.parametrize("resolution", [0, 3, 100, 8192])
def test_other_resolutions_are_refused(resolution):
    with pytest.raises(InputError, match="power of two"):
        MapMaker(constant(), resolution)
