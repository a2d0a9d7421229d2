"""RGB against spectra: grey surfaces agree, metamers under a lamp of lines do not."""

import colour
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.planning.colour import JUST_NOTICEABLE, spectral_effect
from rsibr.planning.metamerism import rgb_mismatch
from rsibr.scene.config import EffectsConfig
from tests.planning.metamers import DAYLIGHT, GRID, OBSERVER, light, lines, matte, metamers


def xyz(illuminant, reflectance):
    """By hand: Σ S R x̄, over the luminance of white."""
    weighted = OBSERVER.values * illuminant[:, None]
    return (weighted * reflectance[:, None]).sum(0) / weighted[:, 1].sum()


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
    effect = spectral_effect({"type": "diffuse"}, None, EffectsConfig())
    assert not effect.on
    assert not effect.missed


def test_what_rgb_gets_wrong_calls_for_spectra():
    effect = spectral_effect(matte(metamers()[1]), light(lines(436, 546, 611)), EffectsConfig())
    assert effect.on
    assert effect.evidence > JUST_NOTICEABLE
    assert effect.error_if_left_out > 1e-4
    assert "reflectance" in effect.why
    assert not spectral_effect(matte(np.full_like(GRID, 0.4)), None, EffectsConfig()).on
    off = spectral_effect(matte(metamers()[1]), light(lines(436, 546, 611)), EffectsConfig(spectral="off"))
    assert off.missed


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
