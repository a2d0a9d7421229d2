"""Frames: orthonormal everywhere, upright where that means something."""

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.frame import frame_of, transported, unit_view, view_frame
from tests.arrays import to_numpy, unit_vectors, vector

AXES = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, -0.0, -1], [-0.0, 0, 1]]


def near_the_poles(rng, count):
    lateral = unit_vectors(rng, count) * 10.0 ** rng.uniform(-12, 0, (count, 1))
    axis = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])[rng.integers(0, 4, count)]
    v = axis + lateral
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("view", AXES)
def test_view_frame_is_right_handed_on_the_axes(view):
    frame = view_frame(view)
    assert np.allclose(frame.T @ frame, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1)
    assert np.allclose(frame[:, 2], view)


def test_view_frame_is_upright(rng):
    for view in unit_vectors(rng, 100):
        x, y, _ = view_frame(view).T
        assert x[1] == 0  # right is horizontal
        assert y[1] > 0  # up is up


def test_view_frame_near_the_poles(rng):
    for view in near_the_poles(rng, 1000):
        frame = view_frame(view)
        assert np.abs(frame.T @ frame - np.eye(3)).max() < 1e-14


def test_frame_of_is_orthonormal_everywhere(rng):
    """Hard case 9 in float32: the axes, signed zeros, and a million directions near every pole."""
    v = np.concatenate([np.array(AXES, dtype=np.float64), near_the_poles(rng, 1_000_000)]).astype(np.float32)
    v /= np.linalg.norm(v.astype(np.float64), axis=1, keepdims=True)
    frame = to_numpy(frame_of(vector(v)))
    gram = np.einsum("ijn,ikn->jkn", frame, frame) - np.eye(3)[..., None]
    assert np.isfinite(frame).all()
    assert np.abs(gram).max() < 3e-7 + 2e-7  # the frame's own error, and that v is unit to 1.2e-7 only
    assert np.array_equal(frame[:, 2].T.astype(np.float32), v.astype(np.float32))


def test_transport_carries_one_view_to_the_other_and_keeps_angles(rng):
    a, b, n = unit_vectors(rng, 1000), unit_vectors(rng, 1000), unit_vectors(rng, 1000)
    carried = to_numpy(transported(vector(a), vector(a), vector(b))).T
    moved = to_numpy(transported(vector(n), vector(a), vector(b))).T
    apart = (a * b).sum(1) > -0.99
    assert np.abs(carried - b)[apart].max() < 2e-5
    assert np.abs((moved * b).sum(1) - (n * a).sum(1))[apart].max() < 2e-5
    axis = np.cross(a, b)
    assert np.abs((moved * axis).sum(1) - (n * axis).sum(1))[apart].max() < 2e-5  # the least rotation: about a × b


def test_transport_between_antipodes_is_finite():
    assert np.isfinite(to_numpy(transported(vector([[0, 1, 0]]), vector([[1, 0, 0]]), vector([[-1, 0, 0]])))).all()


@pytest.mark.parametrize("view", [[0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0], [1, 2], "x", [["a", 1, 2]]])
def test_unit_view_refuses_what_has_no_direction(view):
    with pytest.raises(InputError, match="direction"):
        unit_view(view)


@pytest.mark.parametrize("length", [1e-300, 1e-30, 1.0, 1e30, 1e300])
def test_unit_view_takes_any_length(length):
    assert np.allclose(unit_view(np.array([3.0, 4.0, 0.0]) * length), [0.6, 0.8, 0])
