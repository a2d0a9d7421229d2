"""Proxies times their ratio to the lobes: the BRDF in single directions, which a fit alone does not give."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.bsdf_eval import reflected
from rsibr.lobes.proxy_ratio import NODES, glossy_place, matte_place, proxy_ratios
from rsibr.lobes.split import LobeSplit
from tests.arrays import to_numpy, vector


def test_a_lambertian_lobe_is_its_proxy():
    ratios = proxy_ratios(LobeSplit.of(mi.load_dict({"type": "diffuse", "reflectance": 0.3})))
    assert list(ratios) == ["diffuse"]
    assert ratios["diffuse"] == pytest.approx(np.ones((NODES, NODES, 3)), abs=2e-3)


def test_the_tail_of_a_beckmann_lobe_is_darker_than_its_proxy_and_of_ggx_it_is_not():
    for distribution, low, high in (("beckmann", 0, 0.5), ("ggx", 0.8, 1.25)):
        metal = {"type": "roughconductor", "alpha": 0.15, "distribution": distribution}
        split = LobeSplit.of(mi.load_dict(metal))
        (table,) = proxy_ratios(split).values()
        tail = table[NODES // 2, int(0.85 * NODES)]  # tan θ_h = 5.7 α, at h·v = ¼
        assert (low <= tail).all(), distribution
        assert (tail <= high).all(), distribution


def test_a_dark_material_has_ratios_of_one():
    ratios = proxy_ratios(LobeSplit.of(mi.load_dict({"type": "diffuse", "reflectance": 0.0})))
    assert all(np.isfinite(table).all() for table in ratios.values())


def test_places_span_the_table():
    """Head-on and aligned, at a half vector of slope α, and at grazing angles."""
    up, slant = [0.0, 0.0, 1.0], [np.sin(0.4), 0.0, np.cos(0.4)]
    alpha = float(np.tan(0.2))
    found = to_numpy(glossy_place(vector([up, slant]), vector([up, up]), alpha))
    assert found == pytest.approx(np.array([[0, 0.5], [1, np.sqrt(np.cos(0.2))]]), abs=1e-3)
    assert to_numpy(matte_place(vector([slant]), vector([up]))).ravel() == pytest.approx([np.sqrt(np.cos(0.4)), 1])
    assert reflected(mi.load_dict({"type": "diffuse"}), np.array([up]), np.array([up])).shape == (1, 3)
