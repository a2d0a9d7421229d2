"""Response curves: inverses, slopes, files, calibration."""

from __future__ import annotations

import colour
import numpy as np
import pytest

from rsibr.capture.curves import debevec
from rsibr.capture.curves.curve import KNOTS, Curve, curve_named, curve_names
from rsibr.capture.curves.curve_file import read_curve, write_curve
from rsibr.capture.synthetic.brackets import bracketed
from rsibr.capture.synthetic.sensor import Sensor
from rsibr.errors import InputError


def spread(count=501):
    return np.repeat(np.linspace(0, 1, count)[:, None], 3, axis=1)


def test_srgb_is_that_of_colour_science():
    expected = colour.models.eotf_sRGB(spread())
    assert np.abs(curve_named("srgb").linear(spread()) - expected).max() < 1e-7


@pytest.mark.parametrize("name", ["srgb", "linear"])
def test_encoding_inverts_and_the_slope_is_the_derivative(name):
    curve = curve_named(name)
    assert np.abs(curve.encoded(curve.linear(spread())) - spread()).max() < 1e-6
    inner, step = spread()[5:-5], 1e-3
    by_difference = (curve.linear(inner + step) - curve.linear(inner - step)) / (2 * step)
    assert np.abs(curve.slope(inner) / by_difference - 1).max() < 0.02


def test_an_unknown_name_says_which_is_near():
    assert curve_names() == ["linear", "srgb"]
    with pytest.raises(InputError, match="Did you mean 'srgb'"):
        curve_named("srbg")


def test_a_file_comes_back_by_channel(tmp_path):
    at = np.linspace(0, 1, KNOTS)
    curve = Curve("mine", np.stack([at**power for power in (1.8, 2.0, 2.4)]) + 1e-9 * at)
    write_curve(tmp_path / "curve.csv", curve)
    assert np.abs(read_curve(tmp_path / "curve.csv").linear(spread()) - curve.linear(spread())).max() < 1e-6


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("value,red\n0,0\n", "is no table"),
        ("value,red,green,blue\n0,0,0,0\n1,x,1,1\n", "cannot be read"),
        ("value,red,green,blue\n0,0,0,0\n0.5,1,1,1\n", "do not increase from 0 to 1"),
        ("value,red,green,blue\n0,0,0,0\n0.5,0.7,0.7,0.7\n1,0.6,1,1\n", "increases everywhere"),
        ("value,red,green,blue\n0,0,0,0\n0.5,nan,0.7,0.7\n1,1,1,1\n", "do not increase"),
    ],
)
def test_a_wrong_file_is_one_clear_line(tmp_path, text, says):
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(InputError, match=says):
        read_curve(tmp_path / "curve.csv")


@pytest.mark.slow
def test_a_curve_is_found_in_brackets(rng):
    """A curve that is none of those with a name, from patches of known spread."""
    at = np.linspace(0, 1, KNOTS)
    true = Curve("true", np.tile(at**2.8 + 1e-9 * at, (3, 1)))
    scene = np.exp(rng.normal(-1.0, 1.5, (64, 64, 3)))
    shots = list(bracketed(scene, Sensor(true, full_well=1e6), shots=7, stops=1.5, gain=2.0))
    found, inner = debevec.calibrated(shots), spread()[100:475]
    ratio = found.linear(inner) / true.linear(inner)
    assert np.abs(ratio / np.median(ratio, axis=0) - 1).max() < 0.12
    assert np.median(np.abs(ratio / np.median(ratio, axis=0) - 1)) < 0.03
    with pytest.raises(InputError, match="different, known exposures"):
        debevec.calibrated(shots[:1])
