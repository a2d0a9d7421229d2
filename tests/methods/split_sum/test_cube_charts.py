"""Charts of the sphere: places, moments kept by spreading, cubic interpolation."""

import mitsuba as mi
import numpy as np

from rsibr.geometry.projections.cube import CUBE
from rsibr.methods.split_sum.cube_charts import AXES, interpolated, lagrange, place_in_face, places_in_charts, spread
from rsibr.methods.split_sum.multilevel_sum import REACH, node_directions, window_nodes
from tests.arrays import unit_vectors


def test_faces_are_those_of_the_cube_projection(rng):
    d = unit_vectors(rng, 500)
    sheet, p = CUBE.place(mi.Vector3f(d.T.astype(np.float32)))
    point, face, place = places_in_charts(d, 0.0)
    order = np.argsort(point)
    np.testing.assert_array_equal(face[order], np.array(sheet))
    planar = np.tan(np.pi / 4 * place[order])
    np.testing.assert_allclose(planar[:, 0], 2 * np.array(p.x) - 1, atol=1e-5)
    np.testing.assert_allclose(planar[:, 1], 1 - 2 * np.array(p.y), atol=1e-5)
    found, at = place_in_face(mi.Vector3f(d.T.astype(np.float32)))
    np.testing.assert_array_equal(np.array(found), face[order])
    np.testing.assert_allclose(np.array(at).T, place[order], atol=1e-5)


def test_a_margin_finds_directions_in_every_chart_that_reaches_them(rng):
    d = unit_vectors(rng, 300)
    point, face, place = places_in_charts(d, 0.3)
    assert np.abs(place).max() <= 1.3 + 1e-9
    assert (np.bincount(point, minlength=300) >= 1).all()
    back = np.stack([np.tan(np.pi / 4 * place[:, 0]), np.tan(np.pi / 4 * place[:, 1]), np.ones(len(place))], axis=1)
    world = np.einsum("ni,nij->nj", back, AXES[face])
    np.testing.assert_allclose(world / np.linalg.norm(world, axis=1, keepdims=True), d[point], atol=1e-12)
    reach = np.abs(np.einsum("fij,nj->nfi", AXES, d))
    inside = (reach[..., :2].max(axis=2) <= np.tan(np.pi / 4 * 1.3) * reach[..., 2]) & (d @ AXES[:, 2].T > 0)
    assert inside.sum() == len(point)


def test_spreading_keeps_sums_centroids_and_third_moments(rng):
    place, face = rng.uniform(-1, 1, (50, 2)), rng.integers(0, 6, 50)
    held = spread(place, face, np.ones((50, 1)), 20, 2)[..., 0].astype(np.float64)
    u = (2 * np.arange(-2, 22) + 1) / 20 - 1
    for power in range(4):
        along_u, along_v = (held.sum(axis=axis) * u**power for axis in (1, 2))
        np.testing.assert_allclose(along_u.sum(), (place[:, 0] ** power).sum(), atol=2e-5)
        np.testing.assert_allclose(along_v.sum(), (place[:, 1] ** power).sum(), atol=2e-5)


def test_interpolation_reproduces_cubics(rng):
    size, margin = 12, 2
    u = (2 * np.arange(-margin, size + margin) + 1) / size - 1
    x, y = np.meshgrid(u, u)
    cubic = lambda x, y: np.stack([9 + x**3 - y + 3 * x, 9 + x * y**2 + 4 * y, 9 + y**3 + 4 * x, 1 + 0 * x], axis=-1)  # noqa: E731
    nodes = np.stack([cubic(x, y) * (face + 1) for face in range(6)]).astype(np.float32)
    place, face = rng.uniform(-1, 1, (100, 2)), rng.integers(0, 6, 100)
    at = mi.Point2f(place.T.astype(np.float32))
    got = interpolated(mi.Float(nodes.ravel()), size, margin, mi.UInt32(face.astype(np.uint32)), at)
    np.testing.assert_allclose(np.array(got).T, cubic(*place.T) * (face + 1)[:, None], rtol=1e-5)
    assert np.isclose(sum(lagrange(np.array(0.3))), 1)


def test_a_window_holds_everything_within_the_radius():
    for size in (49, 128):
        radius, reach = REACH * np.pi / (2 * size), window_nodes(size)
        directions = node_directions(size, 2).reshape(6, size + 4, size + 4, 3)
        wide = node_directions(size, reach + 6).reshape(6, size + 2 * reach + 12, -1, 3)[0]
        most = 0
        for row, column in ((0, 0), (0, size // 2), (size + 3, size + 3), (size // 3, 5)):
            near = np.argwhere(wide @ directions[0, row, column] > np.cos(radius))
            most = max(most, np.abs(near - (np.array([row, column]) + reach + 4)).max())
        assert reach - 1 <= most <= reach


def test_interpolation_does_not_undershoot(rng):
    nodes = np.zeros((6, 16, 16, 4), np.float32)
    nodes[:, :, 8:] = 1e6
    nodes += 1e-2
    at = mi.Point2f(rng.uniform(-1, 1, (2, 400)).astype(np.float32))
    got = np.array(interpolated(mi.Float(nodes.ravel()), 12, 2, mi.UInt32(3), at))
    assert got.min() >= np.float32(1e-2)
