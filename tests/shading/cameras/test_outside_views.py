"""Pictures of bakes whose views leave part of the sphere open say how much of them is seen from there."""

from __future__ import annotations

import numpy as np
import pytest

import rsibr
from rsibr.geometry.viewpoints import icosphere
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.render import render
from tests.capture.maps.mirror_maps import mirror_map


@pytest.fixture(scope="module")
def upper(tmp_path_factory):
    views = [one for one in icosphere(1).directions if one[1] > 0.2]
    maps = [mirror_map(one, 16) for one in views]
    return rsibr.import_maps(maps, views, tmp_path_factory.mktemp("import") / "upper.rsibr")


def _outside(bake, direction):
    camera = Camera.look_at(20 * np.array(direction), (0, 0, 0), width=16, height=16)
    return [note for note in render("sphere", bake, camera=camera, rays=1).notes if "outside the stored views" in note]


def test_from_among_the_stored_views_there_is_no_note(upper):
    assert _outside(upper, (0.1, 0.99, 0.1)) == []


def test_from_below_every_pixel_is_outside(upper):
    (note,) = _outside(upper, (0.1, -0.9, 0.2))
    assert note == "100% of the pixels are seen from outside the stored views; the nearest of them answer"
