"""Terms of the albedo against known values and quadrature in float64."""

import numpy as np
import pytest

from rsibr.methods.split_sum.dfg import dfg
from tests import microfacet


@pytest.mark.parametrize(("alpha", "albedo"), [(1.0, 0.30685), (0.5, 0.68785), (0.3, 0.87736), (0.1, 0.9883)])
def test_head_on_with_reflectance_1(alpha, albedo):
    assert dfg(np.array([1.0]), np.array([alpha])).sum() == pytest.approx(albedo, abs=6e-5)


@pytest.mark.parametrize("masking", ["separable", "correlated"])
@pytest.mark.parametrize(("cosine", "alpha"), [(0.9, 0.6), (0.3, 0.3), (0.1, 1.0)])
def test_against_quadrature_over_the_hemisphere(masking, cosine, alpha):
    x, weight = np.polynomial.legendre.leggauss(240)
    z, phi = np.meshgrid((x + 1) / 2, (np.arange(240) + 0.5) * np.pi / 240, indexing="ij")
    sine = np.sqrt(1 - z**2)
    wi = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    wo = np.broadcast_to([np.sqrt(1 - cosine**2), 0, cosine], wi.shape)
    value = microfacet.ggx(wi, wo, alpha) * (weight[:, None] * np.pi / 240)
    if masking == "separable":
        one = lambda c: 2 * c / (c + np.sqrt(alpha**2 + (1 - alpha**2) * c**2))  # noqa: E731
        value = value / microfacet.shadowing(z, cosine, alpha) * one(z) * one(cosine)
    graze = microfacet.schlick((microfacet.unit(wi + wo) * wo).sum(axis=-1))
    wanted = [(value * (1 - graze)).sum(), (value * graze).sum()]
    found = dfg(np.array([cosine]), np.array([alpha]), masking)[0, 0]
    np.testing.assert_allclose(found, wanted, rtol=1.5e-3, atol=1e-5)


def test_a_table_has_a_row_for_each_roughness():
    table = dfg(np.array([0.2, 1.0]), np.array([0.1, 0.5, 0.9]))
    assert table.shape == (3, 2, 2)
    np.testing.assert_allclose(table[1, 1], dfg(np.array([1.0]), np.array([0.5]))[0, 0], rtol=1e-5)
