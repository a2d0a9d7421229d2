"""Shapes by id: any name works, and Mitsuba's ids are those of the scene."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.shading.scenes.object_scene import ObjectScene


def _sphere(x=0.0, radius=1.0):
    return mi.load_dict({"type": "sphere", "center": [x, 0, 0], "radius": radius})


def test_a_scene_without_shapes_is_refused():
    with pytest.raises(InputError, match=r"^empty: no shape to shade"):
        ObjectScene("empty", {})


@pytest.mark.parametrize("names", [("Cube.001", "type"), ("environment", "sensor"), ("a b", "ü=*")])
def test_names_that_are_no_keys_of_mitsuba_work(names):
    scene = ObjectScene("any", {name: _sphere(3.0 * k) for k, name in enumerate(names)})
    assert len(scene.geometry.shapes()) == 2
    assert [shape.id() for shape in scene.geometry.shapes()] == list(names)
    lit = scene.loaded({"environment": {"type": "constant"}})
    assert len(lit.shapes()) == 2
    assert lit.environment() is not None


def test_bounds_centre_and_radius_are_those_of_all_shapes():
    scene = ObjectScene("two", {"a": _sphere(-2.0), "b": _sphere(3.0, radius=0.5)})
    np.testing.assert_allclose(scene.bounds, [[-3, -1, -1], [3.5, 1, 1]], atol=1e-6)
    np.testing.assert_allclose(scene.centre, [0.25, 0, 0], atol=1e-6)
    assert scene.radius == pytest.approx(np.sqrt(6.5**2 + 2**2 + 2**2) / 2)
