"""RGB against spectra: grey surfaces agree, metamers under a lamp of lines do not."""

import colour
import numpy as np
import pytest

from rsibr.effects.metamerism import rgb_mismatch
from rsibr.effects.plan_colour import JUST_NOTICEABLE, spectral_effect
from rsibr.errors import InputError

GRID = np.arange(380.0, 781.0, 5.0)
OBSERVER = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(colour.SpectralShape(380, 780, 5))
DAYLIGHT = colour.SDS_ILLUMINANTS["D65"].copy().align(colour.SpectralShape(380, 780, 5)).values


def spectrum(values, grid=GRID):
    return {"type": "spectrum", "value": [[float(w), float(v)] for w, v in zip(grid, values, strict=True)]}


def matte(values):
    return {"type": "diffuse", "reflectance": spectrum(values)}


def lines(*centres):
    """A lamp of narrow lines over a faint continuum."""
    return 0.05 + sum(3 * np.exp(-(((GRID - centre) / 6) ** 2)) for centre in centres)


def light(values):
    return {"type": "constant", "radiance": spectrum(values)}


def xyz(illuminant, reflectance):
    """By hand: Σ S R x̄, over the luminance of white."""
    weighted = OBSERVER.values * illuminant[:, None]
    return (weighted * reflectance[:, None]).sum(0) / weighted[:, 1].sum()


def metamers():
    """Two reflectances of one colour under daylight: they differ by what the observer's three responses do not see."""
    base = 0.5 + 0.2 * np.sin((GRID - 380) / 60)
    seen = (OBSERVER.values * DAYLIGHT[:, None]).T
    wiggle = 0.3 * np.sin((GRID - 380) / 18) * np.exp(-(((GRID - 570) / 110) ** 2))
    unseen = wiggle - np.linalg.pinv(seen) @ (seen @ wiggle)
    return base, np.clip(base + unseen, 0, 1)


def test_the_two_are_metamers_under_daylight_and_none_under_lines():
    one, two = metamers()
    lamp = lines(436, 546, 611)
    assert np.abs(xyz(DAYLIGHT, one) - xyz(DAYLIGHT, two)).max() < 2e-3
    assert np.abs(xyz(lamp, one) - xyz(lamp, two)).max() > 0.02


def test_a_metamer_under_a_lamp_of_lines_shifts_visibly_in_rgb():
    """RGB gives both metamers one colour under every light; the truth differs: RGB errs for at least one of them."""
    lamp = light(lines(436, 546, 611))
    found = [rgb_mismatch(matte(values), lamp).difference for values in metamers()]
    assert max(found) > 3 * JUST_NOTICEABLE
    daylight = [rgb_mismatch(matte(values), None).difference for values in metamers()]
    assert max(daylight) < JUST_NOTICEABLE


def test_the_truth_is_that_of_a_sum_by_hand():
    """RelMSE from the two colours, computed here."""
    reflectance, lamp = metamers()[1], lines(436, 546, 611)
    space = colour.RGB_COLOURSPACES["ITU-R BT.709"]
    truth = space.matrix_XYZ_to_RGB @ xyz(lamp, reflectance)
    found = rgb_mismatch(matte(reflectance), light(lamp))
    white = space.matrix_XYZ_to_RGB @ xyz(lamp, np.ones_like(GRID))
    daylight = space.matrix_XYZ_to_RGB @ xyz(DAYLIGHT, reflectance)
    by_hand = ((white * daylight - truth) ** 2).mean() / (truth**2).mean()
    assert found.rel_mse == pytest.approx(by_hand, rel=0.1)


@pytest.mark.parametrize("lamp", [None, light(lines(436, 546, 611)), light(np.ones_like(GRID))])
def test_a_neutral_pigment_keeps_its_colour_under_any_light(lamp):
    assert rgb_mismatch(matte(np.full_like(GRID, 0.4)), lamp).difference < 0.3


def test_without_spectra_there_is_nothing_to_mismatch():
    assert rgb_mismatch({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.1, 0.2, 0.3]}}, None) is None
    effect = spectral_effect({"type": "diffuse"}, None)
    assert not effect.on
    assert not effect.missed


def test_what_rgb_gets_wrong_is_flagged_with_its_error():
    effect = spectral_effect(matte(metamers()[1]), light(lines(436, 546, 611)))
    assert effect.missed
    assert effect.evidence > JUST_NOTICEABLE
    assert effect.error_if_left_out > 1e-4
    assert "reflectance" in effect.why
    assert not spectral_effect(matte(np.full_like(GRID, 0.4)), None).missed


def test_spectra_are_found_in_xml_and_in_nested_plugins(tmp_path):
    pairs = ", ".join(f"{w:g}:{v:.4f}" for w, v in zip(GRID, metamers()[1], strict=True))
    file = tmp_path / "m.xml"
    file.write_text(
        f'<bsdf version="3.0.0" type="diffuse"><spectrum name="reflectance" value="{pairs}"/>'
        '<spectrum name="other" value="0.5"/></bsdf>'
    )
    lamp = light(lines(436, 546, 611))
    direct = rgb_mismatch(matte(metamers()[1]), lamp)
    assert rgb_mismatch(file, lamp).difference == pytest.approx(direct.difference, rel=1e-2)
    nested = {"type": "twosided", "inner": matte(metamers()[1])}
    assert rgb_mismatch(nested, lamp) == direct


def test_a_spectrum_that_is_none_is_refused():
    with pytest.raises(InputError, match="spectrum"):
        rgb_mismatch({"type": "diffuse", "reflectance": {"type": "spectrum", "value": [1, 2]}}, None)
