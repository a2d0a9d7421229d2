"""Figures of pictures: how many stand in a row, what is cropped, what the scale says."""

from __future__ import annotations

import numpy as np
import pytest

import rsibr
from rsibr.publishing.notebooks.side_by_side import cropped


def picture(height=8, width=8):
    return np.full((height, width, 4), 255, dtype=np.uint8)


def test_pictures_stand_in_rows_under_their_titles():
    figure = rsibr.side_by_side([(f"p{k}", picture()) for k in range(5)], columns=3)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["p0", "p1", "p2", "p3", "p4", ""]
    assert [len(axes.images) for axes in figure.axes] == [1, 1, 1, 1, 1, 0]


def test_none_leaves_a_place_empty():
    figure = rsibr.side_by_side([("", None), ("right", picture())])
    assert [len(axes.images) for axes in figure.axes] == [0, 1]


def test_what_is_transparent_is_cropped():
    one = picture(6, 9)
    one[..., 3] = 0
    one[1:3, 4:8, 3] = 255
    assert cropped(one).shape == (2, 4, 4)
    assert cropped(np.zeros((3, 3, 4), dtype=np.uint8)).shape == (3, 3, 4)


def test_a_scale_stands_beside_them_with_its_own_words():
    scale = rsibr.pictures.RELATIVE_ERROR
    *_, bar = rsibr.side_by_side([("error", picture())], scale=scale).axes
    assert bar.get_ylabel() == scale.label
    assert [text.get_text() for text in bar.get_yticklabels()] == [text for _, text in scale.ticks]


@pytest.mark.parametrize(("shape", "aspect"), [((10, 20), 0.5), ((10, 10), 1.0), ((20, 10), 1.0)])
def test_a_row_is_as_high_as_its_pictures_but_no_higher_than_wide(shape, aspect):
    width, height = rsibr.side_by_side([("a", picture(*shape)), ("b", picture(*shape))]).get_size_inches()
    assert height - 0.2 == pytest.approx(width / 2 * aspect)
