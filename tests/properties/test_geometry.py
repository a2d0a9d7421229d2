"""Properties of weights, point location, frames and the sphere map, on examples that hypothesis looks for."""

import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rsibr.geometry.frame import frame_of, transported, view_frame
from rsibr.geometry.projections.sphere_map import (
    disk_from_normal,
    disk_from_reflection,
    normal_from_disk,
    reflection_from_disk,
)
from rsibr.geometry.viewpoints import icosphere
from tests.arrays import point, to_numpy, vector
from tests.hard_cases.exact import WEIGHTS, query, side_distances
from tests.properties.strategies import PROFILE, angles, coordinates, directions, rotations

LANES = 64
"""Each example is a whole batch of this size: the kernels are compiled once."""

batches = st.lists(directions, min_size=LANES, max_size=LANES).map(np.stack)
sphere = functools.cache(icosphere)


@pytest.mark.parametrize("kind", WEIGHTS)
@PROFILE
@given(v=batches, level=st.integers(0, 5))
def test_weights_are_a_partition_of_unity_in_a_triangle_that_contains_the_view(v, level, kind):
    """Σw = 1 ± 2e-7, no weight below 0, the view inside by −2e-7 at most."""
    found = query(sphere(level), v, kind)
    assert np.abs(found.weights.sum(axis=0) - 1).max() <= 2e-7
    assert found.weights.min() >= 0
    assert side_distances(found.v, found.corners).min() > -2e-7


@PROFILE
@given(v=batches, level=st.integers(0, 5))
def test_gnomonic_weights_point_back_at_the_view(v, level):
    """Σ w_i v_i is parallel to v: within 4e-7, a few roundings of float32."""
    found = query(sphere(level), v, "gnomonic")
    blended = np.einsum("kn,nkj->nj", found.weights, found.corners)
    assert np.abs(np.cross(blended / np.linalg.norm(blended, axis=1, keepdims=True), found.v)).max() < 4e-7


@pytest.mark.parametrize("kind", WEIGHTS)
@PROFILE
@given(v=batches, level=st.integers(0, 5))
def test_a_kernel_of_weights_keeps_its_order(v, level, kind):
    """Turning a triangle's corners round turns its weights round, to 4e-7."""
    found = query(sphere(level), v, kind)
    a, b, c = (vector(found.corners[:, k]) for k in range(3))
    turned = to_numpy(WEIGHTS[kind](vector(found.v), b, c, a))
    assert np.abs(turned - found.weights[[1, 2, 0]]).max() < 4e-7


@PROFILE
@given(view=directions, angle=angles)
def test_camera_frames_are_rotations_and_upright(view, angle):
    """Orthonormal to 1e-14, x horizontal; turned about +Y with the view, unless at a pole."""
    frame = view_frame(view)
    assert np.abs(frame.T @ frame - np.eye(3)).max() < 1e-14
    assert frame[1, 0] == 0
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    if np.hypot(view[0], view[2]) > 1e-6:
        assert np.abs(view_frame(turn @ view) - turn @ frame).max() < 1e-9


@PROFILE
@given(v=batches)
def test_device_frames_are_rotations(v):
    frame = to_numpy(frame_of(vector(v)))
    assert np.abs(np.einsum("ijn,ikn->jkn", frame, frame) - np.eye(3)[..., None]).max() < 6e-7


@PROFILE
@given(rotation=rotations(), v=batches, n=batches)
def test_the_least_rotation_turns_with_the_world(rotation, v, n):
    """R · transport(n, a, b) = transport(Rn, Ra, Rb), but close to antipodes, where 1/(1 + cos) takes digits."""
    a, b = v, np.roll(v, 1, axis=0)
    apart = (a * b).sum(axis=1) > -0.9
    plain = to_numpy(transported(vector(n), vector(a), vector(b))).T @ rotation.T
    turned = to_numpy(transported(vector(n @ rotation.T), vector(a @ rotation.T), vector(b @ rotation.T))).T
    assert np.abs(plain - turned)[apart].max(initial=0) < 2e-5


@PROFILE
@given(p=st.lists(st.tuples(coordinates, coordinates), min_size=LANES, max_size=LANES).map(np.array))
def test_the_sphere_map_and_its_inverses_agree_in_the_disk(p):
    """Normals come back to 3e-7; mirror directions to 1e-6/cos²θ, the stretch of their map."""
    p = p / np.maximum(1, np.hypot(*p.T) / 0.999)[:, None]
    n = normal_from_disk(point(p))
    assert np.abs(np.linalg.norm(to_numpy(n), axis=0) - 1).max() < 3e-7
    assert np.abs(to_numpy(disk_from_normal(n)).T - p).max() < 3e-7
    back = to_numpy(disk_from_reflection(reflection_from_disk(point(p)))).T
    assert (np.abs(back - p).max(axis=1) * (1 - (p * p).sum(axis=1))).max() < 1e-6
