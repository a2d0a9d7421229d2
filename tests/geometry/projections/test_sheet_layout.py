"""Layouts of sheets in a picture: neighbours in a cross meet at their edges, and splitting undoes joining."""

import numpy as np
import pytest

from rsibr.geometry.projections.projection import projection
from rsibr.geometry.projections.sheet_layout import HORIZONTAL_CROSS, VERTICAL_CROSS, layout_of, layouts
from tests.geometry.projections.projected import sampled


@pytest.mark.parametrize("name", ["cube", "dual-paraboloid", "orthographic-pair", "mirror-ball", "latlong"])
def test_a_picture_splits_into_the_sheets_that_it_was_joined_from(name):
    one = projection(name)
    values = sampled(name, 6).values
    for layout in layouts(one):
        picture = layout.joined(values)
        assert layout_of(one, *picture.shape[:2]) == layout
        assert np.array_equal(layout.split(picture), values)


@pytest.mark.parametrize(
    ("layout", "joints"),
    [
        (HORIZONTAL_CROSS, [((1, 0), (1, 1)), ((1, 1), (1, 2)), ((1, 2), (1, 3)), ((0, 1), (1, 1)), ((1, 1), (2, 1))]),
        (VERTICAL_CROSS, [((1, 0), (1, 1)), ((1, 1), (1, 2)), ((0, 1), (1, 1)), ((1, 1), (2, 1)), ((2, 1), (3, 1))]),
    ],
)
def test_faces_meet_in_a_cross(layout, joints):
    """A smooth radiance goes on across every joint: steps there are as small as within a face."""
    size = 32
    picture = layout.joined(sampled("cube", size).values)
    within = np.abs(np.diff(picture[size : 2 * size, size : 2 * size], axis=1)).max()
    for (row, column), (below, right) in joints:
        if row == below:
            rows, at = slice(row * size, (row + 1) * size), right * size
            step = picture[rows, at] - picture[rows, at - 1]
        else:
            columns, at = slice(column * size, (column + 1) * size), below * size
            step = picture[at, columns] - picture[at - 1, columns]
        assert np.abs(step).max() < 2 * within


@pytest.mark.parametrize(("name", "shape"), [("cube", (48, 63)), ("cube", (40, 48)), ("dual-paraboloid", (8, 8)),
    ("octahedral", (8, 16))])  # fmt: skip
def test_a_picture_of_another_shape_has_no_layout(name, shape):
    assert layout_of(projection(name), *shape) is None
