"""Maps D and S: what they hold, their sizes, and lookups in them."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.methods.miller1984.convolution import convolved
from rsibr.methods.miller1984.illumination import illumination_table
from rsibr.methods.miller1984.polar_table import PolarTable
from rsibr.methods.miller1984.reflectance import VARNISH, lambert, mirror, phong
from rsibr.methods.miller1984.tables import Sizes, diffuse_map, highest_exponent, phong_rows, resized, specular_map
from tests.arrays import unit_vectors
from tests.methods.miller1984.scene import light, one_light, polar_directions, sky

COLOUR = np.array([0.3, 0.6, 1.2])


def vectors(directions):
    return mi.Vector3f(np.ascontiguousarray(np.asarray(directions, dtype=np.float32).T))


def test_a_constant_sky_fills_the_maps_with_the_constants():
    grey = np.full((72, 144, 3), 2.0)
    assert np.allclose(diffuse_map(grey, COLOUR, lambert()), 2 * COLOUR / 4, rtol=2e-4)
    assert np.allclose(specular_map(grey, COLOUR, phong(10), 36, 36), 2 * COLOUR / 22, rtol=2e-3)


def test_the_specular_map_of_a_mirror_is_the_illumination(rng):
    illumination = rng.random((36, 72, 3))
    assert np.array_equal(specular_map(illumination, np.ones(3), mirror(), 36, 36), illumination)


def test_varnish_adds_half_the_illumination(rng):
    illumination = rng.random((36, 72, 3))
    found = specular_map(illumination, COLOUR, phong(20, VARNISH), 36, 36)
    assert np.allclose(found, COLOUR * convolved(illumination, phong(20), 36, 72) + 0.5 * illumination)


def test_a_phong_part_summed_at_fewer_rows_is_interpolated():
    illumination = sky(polar_directions(144))
    many, few = (specular_map(illumination, COLOUR, phong(20, VARNISH), 144, rows) for rows in (144, 72))
    assert np.abs(many - few).max() < 0.01 * many.max()


def test_the_illumination_is_that_of_the_light():
    """Texels 1.25° wide; the lights of the sky are 10° wide."""
    assert np.abs(illumination_table(light(sky, 512), 144) - sky(polar_directions(144))).max() < 0.02


def test_a_light_without_extent_is_in_its_texel():
    d = np.array([0.3, -0.8, 0.52])
    table = illumination_table(one_light(d, COLOUR), 36)
    (row,), (column,) = (np.unique(index) for index in np.nonzero(table.any(axis=-1)))
    assert polar_directions(36)[row, column] @ d / np.linalg.norm(d) > np.cos(0.07)
    areas = np.diff(-np.cos(np.arange(37) * np.pi / 36))[row] * 2 * np.pi / 72
    assert np.allclose(table[row, column] * areas, COLOUR, rtol=1e-5)


@pytest.mark.parametrize("rows", [9, 36])
def test_lookups_agree_with_the_table(rows, rng):
    """Nearest and bilinear, at texels' middles and between them; poles and seam too."""
    table = sky(polar_directions(rows)).astype(np.float32)
    middles = vectors(polar_directions(rows).reshape(-1, 3))
    for lookup in ("nearest", "bilinear"):
        found = np.array(PolarTable.of(table, lookup).fetch(middles)).T.reshape(table.shape)
        assert np.allclose(found, table, atol=1e-4)
    finer = vectors(polar_directions(7 * rows).reshape(-1, 3))
    found = np.array(PolarTable.of(table).fetch(finer)).T.reshape(7 * rows, 14 * rows, 3)
    assert np.allclose(found, resized(table, 7 * rows), atol=2e-4)
    found = np.array(PolarTable.of(table, "nearest").fetch(finer)).T.reshape(7 * rows, 14 * rows, 3)
    assert np.array_equal(found, table.repeat(7, axis=0).repeat(7, axis=1))


def test_a_layer_is_looked_up_in_itself(rng):
    layers = rng.random((3, 6, 12, 3)).astype(np.float32)
    d = vectors(unit_vectors(rng, 30))
    layer = mi.UInt32(np.arange(30, dtype=np.uint32) % 3)
    found = np.array(PolarTable.of(layers).fetch(d, layer)).T
    alone = [np.array(PolarTable.of(one).fetch(d)).T for one in layers]
    assert np.allclose(found, [alone[k % 3][k] for k in range(30)], atol=1e-6)


def test_rows_grow_with_the_exponent_up_to_those_of_the_light():
    rows = [phong_rows(n, 504) for n in (1, 10, 100, 1000, 25_000)]
    assert rows == sorted(rows)
    assert rows[0] == 36
    assert rows[-1] == 504
    assert all(504 % count == 0 for count in rows)
    assert Sizes().of_specular(10, 0.0) == phong_rows(10, 504)
    assert Sizes().of_specular(10, VARNISH) == 504
    assert Sizes(specular=17).of_specular(10, VARNISH) == 17


@pytest.mark.parametrize("n", [1, 1000, highest_exponent(252)])
def test_energy_survives_the_sizes_by_default(n):
    """A constant sky at every texel of S; the worst are the poles, where the sum over rows is a midpoint rule."""
    table = specular_map(np.ones((252, 504, 3)), np.ones(3), phong(n), 36, 36) * 2 * (n + 1)
    assert np.abs(table - 1).max() < 0.1
    assert table.mean() == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize("rows", [0, -3, 2.5, "36"])
def test_a_size_that_is_none_is_refused(rows):
    with pytest.raises(InputError, match="diffuse_rows"):
        Sizes(diffuse=rows)
