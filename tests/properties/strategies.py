"""What the properties are tried on: directions, rotations, skies; and how often."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

settings.register_profile(
    "rsibr",
    derandomize=True,  # the same examples in each run
    deadline=None,  # the first example compiles
    max_examples=25,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
PROFILE = settings.get_profile("rsibr")

coordinates = st.floats(-1, 1, allow_nan=False, width=64)


def _unit(v):
    v = np.array(v)
    return v / np.linalg.norm(v)


directions = st.tuples(coordinates, coordinates, coordinates).filter(lambda v: np.linalg.norm(v) > 1e-3).map(_unit)
"""Unit vectors; hypothesis likes zeros and ones, so that axes, edges and corners of the octants are among them."""

angles = st.floats(-np.pi, np.pi)

seeds = st.integers(0, 2**32 - 1)
"""Roots of random maps: NumPy fills them quicker than hypothesis draws them."""


@st.composite
def rotations(draw):
    """Draw a rotation matrix from an axis and an angle, by Rodrigues' formula."""
    x, y, z = draw(directions)
    angle = draw(angles)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
