"""Which shape is shaded from which bake, seen by rays."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import UNBAKED, SurfaceTypes
from rsibr.shading.surfaces import first_surfaces


@pytest.fixture(scope="module")
def row(variant):
    """Four spheres in a row along x, 3 apart, the last a mesh."""
    shapes = {
        name: mi.load_dict({"type": "sphere", "center": [3 * k, 0, 0]})
        for k, name in enumerate(("body", "glass", "trim"))
    }
    cube = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([9, 0, 0])}
    return ObjectScene("row", shapes | {"box": mi.load_dict(cube)})


def _seen(scene, types):
    """Type of what a ray along −z meets at each shape, and beside them."""
    x = mi.Float([0, 3, 6, 9, 1.5])
    return np.array(types.of(first_surfaces(scene.geometry, mi.Ray3f(mi.Point3f(x, 0, 9), mi.Vector3f(0, 0, -1)))))


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["*"], [0, 0, 0, 0]),
        (["glass", "*"], [1, 0, 1, 1]),
        (["*", "box"], [0, 0, 0, 1]),
        (["trim", "body"], [1, UNBAKED, 0, UNBAKED]),
        ([], [UNBAKED] * 4),
    ],
)
def test_rays_find_the_type_of_the_shape_that_they_meet(row, names, expected):
    types = SurfaceTypes.assign(row, names)
    assert _seen(row, types).tolist() == [*expected, UNBAKED]
    ids = list(row.shapes)
    assert types.unbaked(row) == [name for name, kind in zip(ids, expected, strict=True) if kind == UNBAKED]


def test_a_name_that_no_shape_has_is_refused_with_the_nearest(row):
    with pytest.raises(
        InputError, match=r"^row: no shape 'bodi'\. Did you mean 'body'\? there are: body, glass, trim, box"
    ):
        SurfaceTypes.assign(row, ["bodi"])


def test_types_survive_other_scenes_being_loaded(row):
    types = SurfaceTypes.assign(row, ["glass", "*"])
    other = ObjectScene("other", {"x": mi.load_dict({"type": "sphere"})})
    assert other.geometry is not None
    assert _seen(row, types).tolist() == [1, 0, 1, 1, UNBAKED]
