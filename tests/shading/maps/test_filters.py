"""Filters over patches whose mean is known: closed forms, and a mean over texels by NumPy."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.projections.sphere_map import normal_from_disk
from rsibr.shading.maps.indexing import BY_NORMAL, Patch
from rsibr.shading.maps.maker import MapMaker
from rsibr.shading.maps.map_filter import filter_named, filters
from tests.arrays import disk_grid, point
from tests.shading.analytic import Method, constant

FILTERS = ("none", "mip", "subdivision", "quadrilateral", "sat")
AREAS = ("subdivision", "quadrilateral", "sat")
SIDE = 64


def means(name, method, outlines, side=SIDE):
    """Means of a map over quadrilaterals of points of the disk, (M, 4, 2); (M, 3)."""
    used = filter_named(name)
    read = used.reader(MapMaker(method, side, used.has_levels).maps([np.eye(3)]))
    corners = [normal_from_disk(point(outlines[:, k])) for k in range(4)]
    patch = Patch(normal_from_disk(point(outlines.mean(axis=1))), corners, BY_NORMAL)
    found = read(mi.UInt32(0), patch)
    dr.eval(found)
    return np.array(found, dtype=np.float64).T


def squares(middles, half, turn=0.0):
    """Squares around points, turned by an angle."""
    across = half * np.array([np.cos(turn), np.sin(turn)])
    down = np.array([across[1], -across[0]])
    offsets = np.array([-across - down, across - down, across + down, -across + down])
    return np.asarray(middles)[:, None] + offsets


def test_all_filters_are_found():
    assert set(FILTERS) <= set(filters())
    with pytest.raises(InputError, match="Did you mean 'mip'"):
        filter_named("mipp")


@pytest.mark.parametrize("name", FILTERS)
def test_a_constant_stays_itself_also_at_and_beyond_the_rim(name):
    middles = [[0, 0], [0.7, 0.7], [-0.99, 0], [0, 0.9999], [0.3, -0.2]]
    for half in (1e-4, 0.02, 0.3, 0.9):
        found = means(name, constant(), squares(middles, half, 0.4))
        assert np.allclose(found, [0.25, 0.5, 1.0], rtol=1e-4)


@pytest.mark.parametrize("turn", [0.0, 0.5])
@pytest.mark.parametrize("name", FILTERS)
def test_a_linear_map_gives_its_value_in_the_middle(name, turn, rng):
    linear = Method(lambda n, v: mi.Color3f(2 + n.x, 2 + n.y, 2 - 0.5 * n.x))
    middles = rng.uniform(-0.35, 0.35, (40, 2))
    for half, tolerance in ((0.005, 0.005), (0.08, 0.01)):
        found = means(name, linear, squares(middles, half, turn))
        exact = np.stack([2 + middles[:, 0], 2 + middles[:, 1], 2 - 0.5 * middles[:, 0]], axis=1)
        assert np.abs(found - exact).max() < (0.06 if name == "mip" and half > 0.05 else tolerance)


@pytest.mark.parametrize("name", AREAS)
def test_the_mean_over_a_square_of_waves(name, rng):
    """∫ sin over an axis-parallel square in closed form; a bilinear lookup in the middle is off by 0.3."""
    k, half = 30.0, 0.06
    waves = Method(lambda n, v: mi.Color3f(2 + dr.sin(k * n.x), 2 + dr.sin(k * n.y), 2))
    middles = rng.uniform(-0.4, 0.4, (60, 2))
    damping = np.sin(k * half) / (k * half)
    exact = np.stack([2 + damping * np.sin(k * middles[:, i]) for i in range(2)], axis=1)
    error = np.abs(means(name, waves, squares(middles, half), 128)[:, :2] - exact)
    unfiltered = np.abs(means("none", waves, squares(middles, half))[:, :2] - exact)
    assert np.sqrt((error**2).mean()) < 0.05
    assert np.sqrt((unfiltered**2).mean()) > 0.25


def test_mip_maps_damp_what_is_finer_than_the_footprint(rng):
    k = 60.0
    waves = Method(lambda n, v: mi.Color3f(2 + dr.sin(k * n.x), 2, 2))
    middles = rng.uniform(-0.4, 0.4, (60, 2))
    assert means("mip", waves, squares(middles, 0.1))[:, 0].std() < 0.2
    assert means("none", waves, squares(middles, 0.1))[:, 0].std() > 0.4


@pytest.mark.parametrize("name", AREAS)
def test_a_sun_of_a_million_keeps_its_energy_next_to_darkness(name):
    """Squares that tile the disk hold a sun of 1e6 exactly once, and those beside it stay dark.

    For the summed-area table float32 would not do: it resolves 4e3 of the whole sum.
    """
    light, dark = 1e6, 1e-3

    def radiance(n, v):
        away = dr.square(n.x - 0.2) + dr.square(n.y - 0.1)
        return mi.Color3f(dark) + light * dr.select(away < 0.1**2, 1.0, 0.0)

    half = 1.4 / 16 / 2
    grid = (np.arange(16) + 0.5) * 2 * half - 0.7
    middles = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    middles = middles[np.linalg.norm(middles, axis=1) < 0.75]
    found = means(name, Method(radiance), squares(middles, half))[:, 0]
    energy = found.sum() * (2 * half) ** 2
    x, y = disk_grid(SIDE)
    exact = light * (np.hypot(x - 0.2, y - 0.1) < 0.1).sum() * (2 / SIDE) ** 2
    assert energy == pytest.approx(exact, rel={"sat": 1e-4, "subdivision": 0.05, "quadrilateral": 0.1}[name])
    away = np.linalg.norm(middles - [0.2, 0.1], axis=1)
    bound = 1e-3 if name == "sat" else 1e-5
    assert np.abs(found[away > 0.1 + 3 * half] / dark - 1).max() < bound


def test_sums_in_single_precision_would_lose_the_darkness():
    """Why the table is of float64: the same differences of float32 sums."""
    texels = np.full((256, 256), 1e-3)
    texels[:8, :8] = 1e6
    for dtype, is_right in ((np.float32, False), (np.float64, True)):
        sums = texels.astype(dtype).cumsum(axis=0, dtype=dtype).cumsum(axis=1, dtype=dtype)
        block = sums[200, 200] - sums[180, 200] - sums[200, 180] + sums[180, 180]
        assert (abs(block / (400 * 1e-3) - 1) < 1e-3) == is_right


@pytest.mark.parametrize("name", FILTERS)
def test_folded_and_degenerate_footprints_are_finite(name):
    waves = Method(lambda n, v: mi.Color3f(2 + dr.sin(30 * n.x), 2, 2))
    outlines = np.array(
        [
            [[0, 0], [0.2, 0.2], [0.2, 0], [0, 0.2]],  # a bow tie
            [[0.1, 0.1]] * 4,
            [[0, 0], [0.3, 0], [0.3, 0], [0, 0]],
            [[-1, 0], [1, 0], [0, 1], [0, -1]],
            [[1, 0], [1, 0], [1, 0], [1, 0]],
        ]
    )
    found = means(name, waves, outlines)
    assert np.isfinite(found).all()
    assert found.min() >= 0.99
    assert found.max() <= 3.01


@pytest.mark.parametrize("name", FILTERS)
def test_a_point_is_a_bilinear_lookup(name):
    """Without a footprint every filter is the unfiltered one; so is a footprint far below a texel."""
    waves = Method(lambda n, v: mi.Color3f(2 + dr.sin(9 * n.x), 2 + n.y, 2))
    middles = np.array([[0.1, 0.2], [-0.4, 0.3], [0.6, -0.5]])
    plain = means("none", waves, squares(middles, 1e-5))
    assert np.allclose(means(name, waves, squares(middles, 1e-5)), plain, atol=0.02)
