"""Alignment: what was moved is moved back, what stood still stays, and the frame of the picture is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsibr.capture.brackets.alignment import aligned
from rsibr.capture.curves.linear import LINEAR
from rsibr.capture.curves.srgb import SRGB
from rsibr.capture.hdr import capture_hdr
from rsibr.capture.synthetic.brackets import bracketed
from rsibr.capture.synthetic.sensor import Sensor
from rsibr.errors import InputError


def mirror_ball(side=160):
    """A mirror ball under a sky of smooth colours: it correlates nearly as well a few pixels beside its place."""
    row, column = np.mgrid[:side, :side] / (side / 2) - 1
    depth = np.sqrt(np.maximum(0.7 - row**2 - column**2, 0))
    normal = np.stack([column, -row, depth], axis=-1) / np.sqrt(0.7)
    mirrored = 2 * normal * normal[..., 2:] - np.array([0, 0, 1])
    behind = np.stack([0.05 * column, -0.05 * row, -np.ones_like(row)], axis=-1)
    seen = np.where(depth[..., None] > 0, mirrored, behind)
    return 0.5 + 0.5 * seen / np.linalg.norm(seen, axis=-1, keepdims=True)


@pytest.mark.parametrize("bits", [8, 16])
def test_a_smooth_picture_from_a_tripod_stays(bits):
    """Over 8 seeds, of which correlation alone moves 2."""
    for seed in range(8):
        shots = list(bracketed(mirror_ball(), Sensor(LINEAR, bits), shots=4, gain=2.0, seed=seed))
        found = aligned(shots, LINEAR)
        assert set(found.shifts.values()) == {(0, 0)}, seed
        assert found.left_out == ()


def test_the_frame_is_that_of_the_best_exposed_one(rng):
    """Its size and its middle stay: the field of view, a mask and a circle hold for what comes out."""
    picture = np.exp(rng.normal(-1, 0.6, (24, 32, 3))).repeat(4, 0).repeat(4, 1)
    shots = list(bracketed(picture, Sensor(), shots=3, gain=3.0))
    far = replace(shots[0], values=np.roll(shots[0].values, (6, -9), (0, 1)))
    result = capture_hdr([far, shots[1], shots[2]])
    assert result.shifts == {"shot 0": (9, -6), "shot 1": (0, 0), "shot 2": (0, 0)}
    assert result.image.size == (128, 96)
    still = capture_hdr(shots, align=False).image.radiance
    difference = np.abs(result.image.radiance / still - 1)
    assert np.median(difference[6:-6, 9:-9]) < 0.01
    assert np.isfinite(result.image.radiance).all()
    border = np.ones(difference.shape, bool)  # which the moved one does not show on two sides: from the others
    border[6:-6, 9:-9] = False
    assert np.quantile(difference[border], 0.99) < 0.2


def test_a_curve_is_calibrated_where_all_show_something(rng):
    picture = np.exp(rng.normal(-1, 1, (24, 32, 3))).repeat(4, 0).repeat(4, 1)
    shots = list(bracketed(picture, Sensor(), shots=4, gain=1.0))
    moved = [*shots[:3], replace(shots[3], values=np.roll(shots[3].values, 8, axis=1))]
    result = capture_hdr(moved, curve="debevec")
    assert result.shifts[moved[3].name] == (-8, 0)
    mid = np.full((1, 3), 0.5)
    assert result.curve.linear(mid) == pytest.approx(SRGB.linear(mid), rel=0.3)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (7, 7)])
def test_a_picture_of_few_pixels_is_not_moved(rng, shape):
    shots = list(bracketed(rng.random((*shape, 3)), Sensor(), shots=2, gain=1.0))
    assert capture_hdr(shots).image.size == shape[::-1]


def test_photographs_of_two_sizes_are_refused(rng):
    first, second = bracketed(rng.random((40, 50, 3)), Sensor(), shots=2)
    with pytest.raises(InputError, match=r"shot 1: has 30 × 40 pixels, the first photograph 50 × 40"):
        capture_hdr([first, replace(second, values=second.values[:, :30])])


def test_too_few_pixels_for_a_curve_is_one_clear_line(rng):
    shots = list(bracketed(rng.random((1, 1, 3)), Sensor(), shots=2))
    with pytest.raises(InputError, match="the curve cannot be found"):
        capture_hdr(shots, curve="debevec", align=False)
