import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.shading.pixel_lattice import place_in_pixel, place_steps


def places(rays):
    return np.array(place_in_pixel(dr.arange(mi.UInt32, rays), place_steps(rays))).T


@pytest.mark.parametrize("rays", [1, 2, 4, 9, 16, 64, 1000])
def test_places_are_even_in_both_projections_and_symmetric(rays):
    found = places(rays)
    even = (np.arange(rays) + 0.5) / rays
    assert np.allclose(np.sort(found, axis=0), even[:, None], atol=2e-5)
    assert np.allclose(found + found[::-1], 1, atol=3e-5)


def test_one_ray_is_the_middle():
    assert places(1).tolist() == [[0.5, 0.5]]


@pytest.mark.parametrize("rays", [4, 16, 64])
def test_square_numbers_make_a_turned_square_grid(rays):
    """The nearest neighbour of a place is (k, k√n)/n away: no two lie on a diagonal next to each other."""
    found = places(rays)
    apart = np.linalg.norm(found[:, None] - found[None], axis=-1) + 10 * np.eye(rays)
    assert apart.min() == pytest.approx(np.sqrt(1 + rays) / rays, rel=1e-4)


def test_an_edge_through_a_pixel_is_covered_evenly(rng):
    """Share of 16 places on one side of a line, against the exact area."""
    found, grid = places(16), (np.arange(200) + 0.5) / 200
    dense = np.stack(np.meshgrid(grid, grid), axis=-1)
    errors = []
    for angle, offset in zip(rng.uniform(0, 2 * np.pi, 200), rng.uniform(-0.6, 0.6, 200), strict=True):
        normal = np.array([np.cos(angle), np.sin(angle)])
        errors.append(((found - 0.5) @ normal < offset).mean() - ((dense - 0.5) @ normal < offset).mean())
    assert np.sqrt(np.mean(np.square(errors))) < 0.035  # independent places: 0.09
