"""The facet map: conformal, so that a round blur on the sphere is round in the map."""

import numpy as np
import pytest

from rsibr.methods.rsibr.half_vector_map import angle_per_length, half_vector, half_vector_point, half_vector_texels
from tests.arrays import point, to_numpy, unit_vectors, vector


def in_disk(rng, count, radius=1.0):
    p = rng.uniform(-radius, radius, (count, 2))
    return p[np.hypot(*p.T) < radius]


def normals(p):
    return to_numpy(half_vector(point(p))).T


def test_normal_and_point_are_inverse_both_ways(rng):
    n = unit_vectors(rng, 10_000)
    n[:, 2] = np.abs(n[:, 2])
    assert np.abs(to_numpy(half_vector(half_vector_point(vector(n)))).T - n).max() < 4e-7
    p = in_disk(rng, 10_000, 1.2)  # a little beyond the rim too: images have a border
    assert np.abs(to_numpy(half_vector_point(half_vector(point(p)))).T - p).max() < 6e-7


def test_the_unit_disk_holds_the_facets_that_face_the_viewer():
    assert np.abs(normals([[0.0, 0.0], [1.0, 0.0], [0.0, -1.0]]) - [[0, 0, 1], [1, 0, 0], [0, -1, 0]]).max() < 1e-7


def test_it_stretches_equally_in_all_directions_by_the_stated_factor(rng):
    """Central differences of float64-exact steps: along x, y and a diagonal, and the two axes stay at right angles."""
    p, step = in_disk(rng, 2000), 2.0**-7
    factor = to_numpy(angle_per_length(point(p)))
    moves = [np.array(e) * step for e in ([1, 0], [0, 1], [np.sqrt(0.5), np.sqrt(0.5)])]
    tangents = [(normals(p + m) - normals(p - m)) / (2 * step) for m in moves]
    for tangent in tangents:
        assert np.abs(np.linalg.norm(tangent, axis=1) / factor - 1).max() < 3e-4
    cosine = (tangents[0] * tangents[1]).sum(axis=1) / factor**2
    assert np.abs(cosine).max() < 3e-4


def test_its_factor_halves_from_the_middle_to_the_rim():
    assert to_numpy(angle_per_length(point([[0.0, 0.0], [0.0, 1.0]]))) == pytest.approx([2, 1])


def test_texel_centres_have_row_zero_at_the_top_and_a_border_around():
    p = to_numpy(half_vector_texels(4)).T.reshape(4, 4, 2)
    assert p[0, 0] == pytest.approx([-0.75, 0.75])
    assert p[3, 1] == pytest.approx([-0.25, -0.75])
    framed = to_numpy(half_vector_texels(4, border=1)).T.reshape(6, 6, 2)
    assert np.array_equal(framed[1:-1, 1:-1], p)
    assert framed[0, 5] == pytest.approx([1.25, 1.25])
