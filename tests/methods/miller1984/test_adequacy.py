"""The claim that 36 × 72 texels are adequate for Lambert, against sums at directions of their own."""

from itertools import pairwise

import numpy as np
import pytest

from rsibr.methods.miller1984.adequacy import FINER, lookup_error
from rsibr.methods.miller1984.convolution import texel_areas
from tests.methods.miller1984.scene import polar_directions, sky

ROWS = 126


def spot(rows=ROWS):
    """All light in one texel: the worst case, with a terminator all around."""
    image = np.zeros((rows, 2 * rows, 3))
    image[rows // 3, rows // 5] = 1.0
    return image


def test_the_reference_is_the_closed_form_of_one_light():
    found = lookup_error(spot(), 18)
    place = (ROWS // 3, ROWS // 5)
    energy = texel_areas(ROWS, 2 * ROWS)[place[0], 0, 0]
    cosine = np.maximum(polar_directions(18 * FINER) @ polar_directions(ROWS)[place], 0)
    assert np.allclose(found.exact[..., 0], cosine * energy / (4 * np.pi), atol=1e-12)


def test_one_light_is_the_worst_case():
    """Bilinear: a quarter of a texel's 5° at the terminator, where a ramp of slope 1 begins."""
    found = lookup_error(spot(), 36)
    assert 0.25 * np.radians(5) * 0.7 < found.of_peak < 0.25 * np.radians(5) * 1.4
    assert found.worst > lookup_error(sky(polar_directions(ROWS)), 36).worst


@pytest.mark.parametrize("lookup", ["bilinear", "nearest"])
def test_finer_tables_are_nearer(lookup):
    errors = [lookup_error(sky(polar_directions(ROWS)), rows, lookup).rel_rmse for rows in (9, 18, 36)]
    ratio = 4 if lookup == "bilinear" else 2
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx(ratio, rel=0.3)


def test_the_claim_holds_under_a_sky_with_lamps():
    illumination = sky(polar_directions(ROWS))
    assert lookup_error(illumination, 36).rel_rmse < 0.005
    assert 0.005 < lookup_error(illumination, 36, "nearest").rel_rmse < 0.05


@pytest.mark.parametrize("lookup", ["bilinear", "nearest"])
def test_at_its_texels_middles_a_table_is_exact(lookup):
    found = lookup_error(sky(polar_directions(ROWS)), 18, lookup)
    middles = slice(FINER // 2, None, FINER), slice(FINER // 2, None, FINER)
    assert np.allclose(found.looked_up[middles], found.exact[middles], rtol=1e-5)
