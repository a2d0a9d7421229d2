"""Basis functions of the lobes against the same lobes in float64, written down independently."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes import basis
from tests import microfacet

ALPHAS = [0.1, 0.3, 0.8]


@pytest.fixture
def pair(rng):
    """Directions to the light and to the viewer (2000, 3), above the surface, not at grazing."""
    wi, wo = rng.normal(size=(2, 2000, 3))
    wi[:, 2], wo[:, 2] = np.abs(wi[:, 2]) + 0.1, np.abs(wo[:, 2]) + 0.1
    return microfacet.unit(wi), microfacet.unit(wo)


def on_device(pair):
    return [mi.Vector3f(w.T.astype(np.float32)) for w in pair]


@pytest.mark.parametrize("alpha", ALPHAS)
def test_a_metal_is_that_of_walter_and_its_grazing_term_schlicks(pair, alpha):
    plain, grazing = (np.array(value) for value in basis.ggx(*on_device(pair), alpha))
    wi, wo = pair
    exact = microfacet.ggx(wi, wo, alpha)
    assert plain == pytest.approx(exact, rel=2e-4)
    toward = (microfacet.unit(wi + wo) * wo).sum(axis=-1)
    assert grazing == pytest.approx(exact * microfacet.schlick(toward), rel=2e-3, abs=1e-7)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_a_metal_under_a_coat_is_seen_by_refraction(pair, alpha):
    """Cosine and solid angle change at the coat: cos θ_i/(cos θ_i' η²), and light passes it twice."""
    assert np.array(basis.coated_ggx(*on_device(pair), alpha)) == pytest.approx(
        microfacet.coated_ggx(*pair, alpha), rel=2e-4
    )


def test_matte_lobes_are_cosines(pair):
    bare, coated = (np.array(value) for value in basis.lambert(*on_device(pair)))
    cos_i, cos_o = (w[:, 2] for w in pair)
    assert bare == pytest.approx(cos_i / np.pi, rel=1e-5)
    passed = (1 - microfacet.schlick(cos_i)) * (1 - microfacet.schlick(cos_o))
    assert coated == pytest.approx(cos_i / np.pi * passed, rel=1e-4)
