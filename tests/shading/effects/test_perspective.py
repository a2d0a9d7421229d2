"""Perspective: which lookup the spread of the view calls for."""

import numpy as np
import pytest

from rsibr.shading.cameras.camera import Camera
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.perspective import GRID_SPREAD, ONE_MAP_SPREAD, lookup_for, perspective, spread
from rsibr.shading.lookups import registry


def test_the_spread_is_the_angle_of_the_object(evidence):
    assert spread(evidence(spread=0.3)) == pytest.approx(0.3)
    inside = evidence()
    assert spread(Evidence(inside.of_scene, Camera.look_at((0, 0, 0.1), (0, 0, 0)))) == np.pi


def test_no_more_than_the_picture_shows(evidence):
    found = evidence(spread=0.5)
    narrow = Camera.look_at(found.camera.position, found.scene.centre, fov_deg=5)
    assert spread(Evidence(found.of_scene, narrow)) == pytest.approx(2 * np.arctan(2**0.5 * np.tan(np.radians(2.5))))


@pytest.mark.parametrize(
    ("angle", "expected"),
    [(0.5 * ONE_MAP_SPREAD, "map-reflection"), (0.5 * GRID_SPREAD, "map-grid"), (2 * GRID_SPREAD, "pixel")],
)
def test_the_spread_decides_between_the_lookups(angle, expected, evidence, monkeypatch):
    effect = perspective(evidence(spread=angle))
    assert effect.on == (expected != "map-reflection")
    assert effect.forced is None
    every = dict.fromkeys(("pixel", "map-reflection", "map-grid"))
    monkeypatch.setattr("rsibr.shading.effects.perspective.lookups", lambda: every)
    assert lookup_for(effect) == expected
    monkeypatch.setattr("rsibr.shading.effects.perspective.lookups", lambda: {"pixel": None})
    assert lookup_for(effect) == "pixel"
    assert "pixel" in registry.lookups()


def test_a_lookup_that_was_asked_for_is_told(evidence):
    one = perspective(evidence(spread=0.5, lookup="map-reflection"))
    assert not one.on
    assert one.forced == "off"
    assert one.missed
    assert one.error_if_left_out == pytest.approx(0.11 * 0.25)
    assert lookup_for(one, "map-normal") == "map-normal"
    assert perspective(evidence(spread=0.01, lookup="pixel")).forced == "on"
    assert lookup_for(perspective(evidence(lookup="pixel", switches={"perspective": "on"})), "pixel") == "pixel"
