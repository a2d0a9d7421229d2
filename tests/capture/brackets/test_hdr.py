"""Brackets in a closed loop: a known picture, photographed with curve, noise and steps, comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsibr.capture.brackets.hdr_image import read_hdr_image
from rsibr.capture.brackets.merge import merged
from rsibr.capture.brackets.noise_model import NoiseModel
from rsibr.capture.curves.linear import LINEAR
from rsibr.capture.curves.srgb import SRGB
from rsibr.capture.hdr import capture_hdr
from rsibr.capture.photographs.exposure import Exposure
from rsibr.capture.synthetic.brackets import bracketed
from rsibr.capture.synthetic.camera_file import write_photograph
from rsibr.capture.synthetic.sensor import Sensor
from rsibr.errors import InputError
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.panorama.rec709 import rec709_picture

NOISE = NoiseModel(30_000, 5)
GAIN = 20.0


@pytest.fixture
def scene(rng):
    """Patches over nine stops, a sun of 1e5, and a corner that no shot sees."""
    picture = np.exp(rng.normal(-1, 1.5, (16, 16, 3))).repeat(8, 0).repeat(8, 1)
    picture[50:52, 30:32] = 1e5
    picture[:8] = 1e-6
    return picture


def found_of(scene, sensor=None, curve=SRGB, **options):
    return merged(list(bracketed(scene, sensor or Sensor(), gain=GAIN, **options)), curve, NOISE)


@pytest.mark.parametrize(("bits", "curve"), [(8, SRGB), (16, LINEAR)], ids=["jpeg", "tiff"])
def test_radiance_comes_back_and_its_variance_is_true(scene, bits, curve):
    image = found_of(scene, Sensor(curve, bits), curve)
    seen = ~image.saturated.any(axis=2)
    seen[:8] = False
    error = np.abs(image.radiance / GAIN / scene - 1)[seen]
    assert np.median(error) < 0.01
    assert np.quantile(error, 0.99) < 0.05
    scores = (image.radiance / GAIN - scene)[seen] / np.sqrt(image.variance[seen] / GAIN**2)
    assert abs(scores.mean()) < 0.05  # 0.004 by chance
    assert scores.std() == pytest.approx(1, abs=0.1)


def test_what_is_saturated_in_every_shot_is_a_bound_and_never_black(scene):
    image = found_of(scene)
    sun = scene[..., 0] >= 1e5
    assert np.array_equal(image.saturated.all(axis=2), sun)
    assert not image.saturated[~sun].any()
    assert (image.radiance[sun] > 0.9 / Exposure(2.0**-14).amount).all()
    assert (image.radiance[sun] < GAIN * 1e5).all()
    assert (image.radiance[:8] < 1e-3).all()  # black is black, not a bound


def test_a_shot_in_which_the_sun_has_moved_does_not_make_it_black(scene):
    shots = list(bracketed(scene, Sensor(), gain=GAIN))
    shots[-1] = replace(shots[-1], values=np.roll(shots[-1].values, 20, axis=1))
    image = merged(shots, SRGB, NOISE)
    sun = scene[..., 0] >= 1e5
    assert image.saturated[sun].all()
    assert (image.radiance[sun] > 0.5 / Exposure(2.0**-12).amount).all()


def test_one_shot_alone_is_its_curve(scene):
    (shot,) = bracketed(scene, Sensor(full_well=1e8, read_noise=1e-3), shots=1, gain=1.0)
    image = merged([shot], SRGB, NOISE)
    inside = (scene < 0.9) & (scene > 0.05)
    assert np.abs(image.radiance / scene - 1)[inside].max() < 0.03  # a step of 8 bits


def test_hand_held_brackets_are_aligned():
    _, panorama, _ = rec709_picture(scenes() / "environments" / "courtyard.exr", 2**30)
    panorama = panorama[:512, :1024].reshape(128, 4, 256, 4, 3).mean(axis=(1, 3))
    shots = list(bracketed(panorama, Sensor(), gain=1 / float(np.median(panorama)), shots=6))
    moves = [(3, -2), (0, 0), (-5, 7), (1, 4), (-2, -3), (6, 1)]
    moved = [
        replace(one, values=np.roll(one.values, (rows, columns), (0, 1)))
        for one, (columns, rows) in zip(shots, moves, strict=True)
    ]
    result = capture_hdr(moved, noise=NOISE)
    anchor = next(index for index, one in enumerate(moved) if result.shifts[one.name] == (0, 0))
    for one, (columns, rows) in zip(moved, moves, strict=True):
        expected = moves[anchor][0] - columns, moves[anchor][1] - rows
        assert result.shifts[one.name] == expected
    assert result.left_out == ()


def test_what_a_tripod_took_is_kept_even_where_nothing_is_seen(rng):
    panorama = np.exp(rng.normal(-1, 0.7, (64, 64, 3)))
    panorama[10, 12] = 1e4
    shots = list(bracketed(panorama, Sensor(), gain=1.0))
    result = capture_hdr(shots, noise=NOISE)
    assert result.left_out == ()
    assert result.image.size == (64, 64)


def test_from_files_to_a_file_that_is_an_environment(tmp_path, scene):
    paths = []
    for index, shot in enumerate(bracketed(scene, Sensor(), gain=GAIN)):
        paths.append(tmp_path / f"{index}.png")
        write_photograph(paths[-1], np.rint(shot.values * 255).astype(np.uint8), shot.exposure)
    result = capture_hdr(paths, align=False)
    result.image.write(tmp_path / "merged.exr")
    again = read_hdr_image(tmp_path / "merged.exr")
    assert np.array_equal(again.radiance, result.image.radiance)
    assert np.array_equal(again.saturated, result.image.saturated)
    assert result.saturated_pixels == 4
    assert result.saturated_box == (30, 31, 50, 51)
    environment = load_environment(EnvironmentConfig(file=tmp_path / "merged.exr"))
    assert np.array_equal(environment.image, result.image.radiance)


def test_mistakes_are_one_clear_line(tmp_path, scene):
    shots = list(bracketed(scene, Sensor(), shots=2))
    with pytest.raises(InputError, match="no photographs"):
        capture_hdr([])
    with pytest.raises(InputError, match="has no exposure"):
        capture_hdr([replace(shots[0], exposure=None)])
    with pytest.raises(InputError, match="3 exposures for 2 photographs"):
        capture_hdr(shots, exposures=[1, 2, 3])
    with pytest.raises(InputError, match="64 × 128"):
        capture_hdr([shots[0], replace(shots[1], values=shots[1].values[:, :64])], align=False)
    with pytest.raises(InputError, match="unknown curve"):
        capture_hdr(shots, curve="rec709")
    with pytest.raises(InputError, match=r"no such file|No such file"):
        capture_hdr(shots, curve="none.csv")
    (tmp_path / "x.exr").write_bytes(b"no")
    with pytest.raises(InputError, match="is no capture"):
        read_hdr_image(tmp_path / "x.exr")
