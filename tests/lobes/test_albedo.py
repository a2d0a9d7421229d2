"""Directional albedos of lobes with a closed form, and their mean over a sphere map."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.albedo import albedo_tables, node_cosines, over_disk
from rsibr.lobes.basis import ggx
from tests import microfacet


class Lambertian:
    """A matte lobe of albedo 0.6, and one that goes with the viewer's cosine: a Seeliger-like 0.6 cos θ_o."""

    def parts(self, wi, wo):
        matte = 0.6 * dr.maximum(wi.z, 0) * dr.inv_pi
        return [mi.Color3f(matte), mi.Color3f(matte * wo.z, 0, matte)]


def test_the_albedo_of_a_cosine_lobe_is_its_factor():
    plain, tilted = albedo_tables(Lambertian(), 2**10)
    assert plain == pytest.approx(np.full((65, 3), 0.6), abs=2e-3)
    assert tilted[:, 0] == pytest.approx(0.6 * node_cosines(), abs=2e-3)
    assert (tilted[:, 1] == 0).all()


@pytest.mark.parametrize("alpha", [0.05, 0.4])
def test_the_albedo_of_a_metal_is_that_of_its_facets(alpha):
    """Σ over facets of equal projected area, in float64, at cosines of 0.25, 0.56 and 1."""

    class Metal:
        def parts(self, wi, wo):
            return [mi.Color3f(dr.select(wi.z > 0, ggx(wi, wo, alpha)[0], 0))]

    (table,) = albedo_tables(Metal(), 2**12)
    chosen = np.array([32, 48, 64])
    sine, cosine = np.sqrt(1 - node_cosines()[chosen] ** 2), node_cosines()[chosen]
    v = np.stack([sine, 0 * sine, np.minimum(cosine, 1 - 1e-9)], axis=1)
    v[-1] = microfacet.unit(np.array([1e-3, 0, 1]))
    n = np.broadcast_to([0.0, 0.0, 1.0], v.shape)
    _, exact = microfacet.metal(lambda d: d, n, v, alpha)
    assert table[chosen, 1] == pytest.approx(exact, abs=3e-3)


@pytest.mark.parametrize("power", [0, 1, 2])
def test_the_mean_over_the_disk_goes_with_the_projected_area(power):
    """∫ 2 cos θ cosᵖ θ d cos θ = 2/(p + 2): a ring of the map is as large as its normals are seen."""
    table = np.repeat(node_cosines()[:, None] ** power, 3, axis=1)
    assert over_disk(table) == pytest.approx(np.full(3, 2 / (power + 2)), rel=1e-3)
