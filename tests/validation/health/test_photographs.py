"""Maps of a capture held against each other: exact maps of a mirror, one of them wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import stored_coverage
from rsibr.store.map_file import MapFile
from rsibr.validation.health.photographs.judgement import _untold, judged
from rsibr.validation.health.photographs.registration import Agreement
from tests.capture.maps.mirror_maps import mirror_map, turned, uneven

COUNT, WRONG = 10, 4
NAMES = [f"shot_{k}.png" for k in range(COUNT)]


def as_map(view, image):
    frame = view_frame(view)
    return MapFile(frame[:, 2].copy(), frame, {"radiance": image}, np.zeros_like(image), stored_coverage(len(image)))


@pytest.fixture(scope="module")
def sound():
    return [as_map(view, mirror_map(view)) for view in uneven(COUNT)]


def with_wrong(sound, image):
    return [*sound[:WRONG], replace(sound[WRONG], layers={"radiance": image}), *sound[WRONG + 1 :]]


def test_none_of_the_sound_ones_is_accused(sound):
    assert judged(sound, NAMES, "reflection").suspects == ()


def wrong_images():
    view = uneven(COUNT)[WRONG]
    image = mirror_map(view)
    return {
        "upside down": (np.ascontiguousarray(image[::-1, ::-1]), "orientation"),
        "mirrored": (np.ascontiguousarray(image[:, ::-1]), "orientation"),
        "a stop too bright": (image * np.float32(2), "exposure"),
        "a stop too dark": (image / np.float32(2), "exposure"),
        "moved by 2°": (mirror_map(view, moved=turned(2)), "pose"),
        "another one": (mirror_map(-view[[2, 0, 1]]), "content"),
    }


SEEN_FAST = ("upside down", "moved by 2°")


@pytest.mark.parametrize(
    "how", [how if how in SEEN_FAST else pytest.param(how, marks=pytest.mark.slow) for how in wrong_images()]
)
def test_the_wrong_one_is_named_with_its_fault_and_no_other(sound, how):
    image, fault = wrong_images()[how]
    found = judged(with_wrong(sound, image), NAMES, "reflection").suspects
    assert [(one.view, one.name, one.fault) for one in found] == [(WRONG, "shot_4.png", fault)]


@pytest.mark.slow
def test_the_figures_of_exposure_and_pose(sound):
    bright, _ = wrong_images()["a stop too bright"]
    moved, _ = wrong_images()["moved by 2°"]
    assert judged(with_wrong(sound, bright), NAMES, "reflection").suspects[0].value == pytest.approx(1, abs=0.1)
    assert judged(with_wrong(sound, moved), NAMES, "reflection").suspects[0].value == pytest.approx(2, abs=0.3)


def test_too_few_are_not_judged(sound):
    assert "from 6 on" in judged(sound[:5], NAMES[:5], "reflection").note


@pytest.mark.slow
def test_where_nothing_is_in_common_poses_are_not_judged(sound):
    rng = np.random.default_rng(2)
    plain = [
        replace(one, layers={"radiance": (1 + 0.02 * rng.normal(size=one.radiance.shape)).astype(np.float32)})
        for one in sound
    ]
    found = judged(plain, NAMES, "reflection")
    assert found.suspects == ()
    assert "too little detail" in found.note


def _agreeing(*pairs):
    return [Agreement(degrees, error, 0.9) for degrees, error in pairs]


def test_of_which_photographs_a_wrong_pose_cannot_be_told_is_said():
    names = ["a", "b", "c", "d"]
    sharp = _agreeing((0.1, 0.05), (0.1, 0.05), (0.1, 0.05), (0.1, 0.05))
    assert _untold(sharp, set(), names) == ""
    one_blurred = [*sharp[:2], *_agreeing((0.1, 0.4)), sharp[3]]
    assert _untold(one_blurred, set(), names) == (
        "a pose off by 2° cannot be told of c: too little detail agrees with the others"
    )
    assert _untold(one_blurred, {2}, names) == ""
    all_blurred = _agreeing((0.1, 0.5), (0.1, 0.3), (0.1, 0.5), (9, 0.5))
    assert _untold(all_blurred, {3}, names) == (
        "poses that are off by 2° cannot be told: too little detail agrees; only from 2.4° on"
    )


def test_sound_maps_with_detail_are_judged_without_a_note(sound):
    assert judged(sound, NAMES, "reflection").note == ""
