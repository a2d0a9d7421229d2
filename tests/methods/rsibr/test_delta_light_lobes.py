"""Lights without extent in the prediction: the closed form against the BSDF itself, at points and over texels."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import covered_middle, normal_from_disk, texel_centres, texel_coverage
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.radiance import Light
from rsibr.lobes.proxy_ratio import proxy_ratios
from rsibr.lobes.split import LobeSplit
from rsibr.methods.rsibr.delta_light_lobes import DeltaLightLobes
from rsibr.store.manifest import LobeRecord, ProxyRecord
from tests.arrays import to_numpy, unit_vectors, vector

MATERIALS = {
    "beckmann": {"type": "roughconductor", "material": "Al", "alpha": 0.2},
    "plastic": {"type": "roughplastic", "alpha": 0.1, "diffuse_reflectance": {"type": "rgb", "value": [0.6, 0.2, 0.1]}},
    "principled": {"type": "principled", "roughness": 0.4, "clearcoat": 1.0, "metallic": 0.5},
}

LIGHTS = DeltaLights(
    np.array([[0.0, 0.6, 0.8], [0.96, -0.28, 0.0]], np.float32), np.array([[3, 2, 1], [0.5, 1, 4]], np.float32)
)


def lobes_of(bsdf, ratios=True):
    """Lights and lobes of a material on the device; `ratios` false leaves the fit as it is."""
    split = LobeSplit.of(bsdf)
    records = [
        LobeRecord(
            name=lobe.name,
            alpha=lobe.alpha,
            albedo=tuple(map(tuple, lobe.albedo)),
            proxies=tuple(
                ProxyRecord(alpha=alpha, coefficients=tuple(map(tuple, colours)))
                for alpha, colours in zip(lobe.proxy.alphas, lobe.proxy.coefficients, strict=True)
            ),
        )
        for lobe in split.lobes
    ]
    light = Light(np.zeros((8, 8, 3), np.float32), delta=LIGHTS, proxy_ratios=proxy_ratios(split) if ratios else {})
    return DeltaLightLobes.of(light, records)


def true_radiance(bsdf, n, v):
    """Σ irradiance · f cos θ_i by the BSDF's own eval, shape (N, 3)."""
    frame = mi.Frame3f(vector(n))
    si = dr.zeros(mi.SurfaceInteraction3f, len(n))
    si.t, si.sh_frame, si.n, si.wi = (
        1.0,
        mi.Frame3f(mi.Vector3f(0, 0, 1)),
        mi.Normal3f(0, 0, 1),
        frame.to_local(vector(v)),
    )
    total = 0
    for direction, irradiance in zip(LIGHTS.directions, LIGHTS.irradiance, strict=True):
        wi = frame.to_local(mi.Vector3f(*direction.tolist()))
        total = total + to_numpy(bsdf.eval(mi.BSDFContext(), si, wi)).reshape(3, -1).T * irradiance
    return total


def rel_mse(found, true):
    return ((found - true) ** 2 / (true**2 + (0.1 * true.mean(axis=0)) ** 2)).mean()


@pytest.mark.parametrize("name", MATERIALS)
def test_points_have_the_radiance_of_the_bsdf(name, rng):
    """At random normals and views; a Beckmann metal by its fit alone errs by 0.3."""
    bsdf = mi.load_dict(MATERIALS[name])
    v = unit_vectors(rng, 4000)
    n = unit_vectors(rng, 4000)
    n *= np.where((n * v).sum(axis=1, keepdims=True) < 0, -1, 1)
    true = true_radiance(bsdf, n, v)
    found = to_numpy(lobes_of(bsdf).radiance(vector(n), vector(v))).T
    assert rel_mse(found, true) < 5e-3
    assert found.mean(axis=0) == pytest.approx(true.mean(axis=0), rel=0.01)
    if name == "beckmann":
        fitted = to_numpy(lobes_of(bsdf, ratios=False).radiance(vector(n), vector(v))).T
        assert rel_mse(fitted, true) > 0.1


def test_a_texel_has_the_mean_over_its_part_inside_the_disk(rng):
    """A highlight a tenth of a texel wide, against 4096 random points a texel."""
    side, frame = 8, view_frame([0.3, 0.5, 0.8])
    bsdf = mi.load_dict({"type": "roughconductor", "alpha": 0.025, "distribution": "ggx"})
    lobes = lobes_of(bsdf)
    matrix = mi.Matrix3f(frame.astype(np.float32))
    n = normal_from_disk(covered_middle(texel_centres(side), side))
    found = to_numpy(lobes.mean_over_texel(n, matrix, mi.Float(2 / side))).T
    x, y = rng.random((2, side**2, 4096)) * (2 / side) + to_numpy(texel_centres(side))[:, :, None] - 1 / side
    inside = x**2 + y**2 < 1
    local = np.stack([x, y, np.sqrt(np.where(inside, 1 - x**2 - y**2, 1))], axis=-1).reshape(-1, 3)
    world = vector(local @ frame.T)
    values = to_numpy(lobes.radiance(world, mi.Vector3f(*frame[:, 2].tolist()))).T.reshape(side**2, -1, 3)
    count = inside.sum(axis=1)[:, None]
    covered = texel_coverage(side).ravel() > 0.3
    mean = ((values * inside[..., None]).sum(axis=1) / np.maximum(count, 1))[covered]
    assert (found[covered] - mean) == pytest.approx(np.zeros_like(mean), abs=0.02 * mean.max())
    assert found[covered].sum(axis=0) == pytest.approx(mean.sum(axis=0), rel=0.02)


def test_a_light_below_the_surface_and_a_dark_one_add_nothing():
    bsdf = mi.load_dict(MATERIALS["beckmann"])
    n = vector([[0.0, -1.0, 0.0]])  # both lights are behind it, or at the horizon
    assert to_numpy(lobes_of(bsdf).radiance(n, n))[:, 0] == pytest.approx(
        true_radiance(bsdf, [[0, -1.0, 0]], [[0, -1.0, 0]])[0], abs=1e-3
    )
    dark = DeltaLights(LIGHTS.directions, 0 * LIGHTS.irradiance)
    assert DeltaLightLobes.of(Light(np.zeros((8, 8, 3), np.float32), delta=dark), []) is None
