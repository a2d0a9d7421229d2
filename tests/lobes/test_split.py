"""Lobes: an exact split, whatever the stand-ins; albedos by quadrature against Mitsuba's own sampling."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.blocks import block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.lobes.albedo import NODES, node_cosines
from rsibr.lobes.basis import LAMBERT, ggx
from rsibr.lobes.bsdf_eval import interaction, reflected
from rsibr.lobes.fit import fit_lobes
from rsibr.lobes.probe_directions import probe_directions
from rsibr.lobes.shape_fit import angle_errors, shape_values
from rsibr.lobes.split import MIRROR, LobeSplit
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from tests.arrays import to_numpy, unit_vectors, vector

GLOSSY = ["clearcoat-red", "glossy-plastic", "rough-aluminium", "pearl-white"]


def preset(name):
    return load_material(MaterialConfig(preset=name)).bsdf()


def upper(rng, count):
    v = unit_vectors(rng, count)
    v[:, 2] = np.abs(v[:, 2])
    return v


@pytest.mark.parametrize("name", [*GLOSSY, "matte-lambert"])
def test_shares_are_a_partition_of_one_everywhere(name, rng):
    split = LobeSplit.of(preset(name))
    wi = np.concatenate([upper(rng, 2000), [[0, 0, 1], [1, 0, 0], [1e-6, 0, 1], [0, 1, 1e-7]]])
    wo = np.concatenate([upper(rng, 2000), [[0, 0, 1], [-1, 0, 0], [0, 0, 1], [0, -1, 1e-7]]])
    shares = np.array([to_numpy(share) for share in split.shares(vector(wi), vector(wo))])
    assert np.isfinite(shares).all()
    assert shares.min() >= 0
    assert np.abs(shares.sum(axis=0) - 1).max() < 1e-6


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.4])
def test_fit_finds_the_roughness_of_a_microfacet_material(alpha):
    lobes = fit_lobes(mi.load_dict({"type": "roughconductor", "alpha": alpha, "distribution": "ggx"}))
    strongest = max(lobes, key=lambda lobe: sum(float(c.sum()) for c in lobe.coefficients))
    assert min(strongest.alphas) < alpha * 1.5
    assert max(strongest.alphas) > alpha / 1.5


def test_lobes_are_fitted_per_channel():
    """A red paint's highlight is white: the diffuse lobe has next to no green and blue, the glossy ones have."""
    lobes = LobeSplit.of(preset("clearcoat-red")).lobes
    diffuse = lobes[0].albedo[-1]
    glossy = sum(lobe.albedo[-1] for lobe in lobes[1:])
    assert lobes[0].is_diffuse
    assert diffuse[0] > 10 * diffuse[1]
    assert glossy[1] > diffuse[1]


def test_lambert_is_one_matte_lobe_of_its_albedo():
    (lobe,) = LobeSplit.of(mi.load_dict({"type": "diffuse", "reflectance": 0.5})).lobes
    assert lobe.alpha == LAMBERT
    assert np.abs(lobe.albedo - 0.5).max() < 1e-3


def test_a_delta_mirror_is_one_lobe_of_its_reflectance():
    (lobe,) = LobeSplit.of(mi.load_dict({"type": "conductor", "material": "none"})).lobes
    assert lobe.alpha == MIRROR
    assert np.abs(lobe.albedo - 1).max() < 1e-6


def test_a_smooth_plastic_is_a_matte_lobe_and_a_mirror():
    split = LobeSplit.of(mi.load_dict({"type": "plastic", "diffuse_reflectance": 0.5}))
    assert [lobe.alpha for lobe in split.lobes] == [LAMBERT, MIRROR]
    assert split.lobes[1].albedo[-1] == pytest.approx((0.49 / 2.49) ** 2, rel=3e-3)  # Fresnel, head-on, IOR 1.49


@pytest.mark.parametrize("name", GLOSSY)
def test_albedos_add_up_to_what_sampling_the_bsdf_gives(name, rng):
    """Quadrature against Monte Carlo with another code path; 5 sigma of the latter and 0.3 % of the former."""
    bsdf, count = preset(name), 2**17
    total = sum(lobe.albedo for lobe in LobeSplit.of(bsdf).lobes)
    for node in (8, 24, NODES - 1):
        c = node_cosines()[node]
        wo = vector(np.tile([np.sqrt(1 - c * c), 0, c], (count, 1)))
        draws = rng.random((3, count)).astype(np.float32)
        _, weight = bsdf.sample(mi.BSDFContext(), interaction(wo), mi.Float(draws[0]), mi.Point2f(draws[1:]))
        sampled = to_numpy(weight)
        error = 5 * sampled.std(axis=1) / np.sqrt(count) + 3e-3 * total[node]
        assert (np.abs(sampled.mean(axis=1) - total[node]) < error).all()


def test_proxy_with_the_roughness_of_a_mitsuba_conductor_has_its_shape(rng):
    """Independent code: Mitsuba's GGX with F = 1; its masking is separable, ours height-correlated: alike head-on."""
    bsdf = mi.load_dict({"type": "roughconductor", "material": "none", "alpha": 0.2, "distribution": "ggx"})
    wi = upper(rng, 500) * [0.3, 0.3, 1]
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    wo = np.tile([0.0, 0.0, 1.0], (500, 1))
    ours = to_numpy(ggx(vector(wi), vector(wo), 0.2)[0])
    assert np.abs(ours / reflected(bsdf, wi, wo)[:, 0] - 1).max() < 2e-3


@pytest.mark.parametrize("name", GLOSSY)
def test_lobe_maps_add_up_to_the_plain_bake(name, asymmetric_environment):
    """The same samples, shared out: equal to rounding, texel by texel; so is the variance of the sum."""
    light, bsdf, frame = (
        load_environment(EnvironmentConfig(file=asymmetric_environment)),
        preset(name),
        view_frame([1, 2, 3]),
    )
    plain = bake_view(SphereIntegrator(light.emitter(), bsdf, 16), frame, block_sizes(64), seed=2, index=1)
    split = SphereIntegrator(light.emitter(), bsdf, 16, LobeSplit.of(bsdf))
    apart = bake_view(split, frame, block_sizes(64), seed=2, index=1)
    assert list(apart.layers) == split.lobe_names
    assert np.abs(apart.radiance - plain.layers["radiance"]).max() < 1e-5 * plain.layers["radiance"].max()
    assert np.abs(apart.variance - plain.variance).max() < 1e-4 * plain.variance.max()


@pytest.mark.parametrize("name", ["clearcoat-red", "rough-aluminium"])
def test_every_lobe_has_its_own_shape(name):
    """Fitted to f·ω_k: at the probe directions each shape is its part of the BRDF, and together they are the BRDF."""
    bsdf, probes = preset(name), probe_directions()
    split = LobeSplit.of(bsdf)
    parts = [to_numpy(part).T for part in split.parts(vector(probes.wi), vector(probes.wo))]
    shapes = [shape_values(lobe.shape, probes) for lobe in split.lobes]
    for part, shape in zip(parts, shapes, strict=True):
        assert angle_errors(part, shape, probes).mean() < 0.1
    whole = angle_errors(reflected(bsdf, probes.wi, probes.wo), sum(shapes), probes)
    assert whole[:-1].max() < 0.05


def test_a_delta_lobe_has_the_shape_of_a_mirror():
    matte, mirror = LobeSplit.of(mi.load_dict({"type": "plastic", "diffuse_reflectance": 0.5})).lobes
    assert matte.shape.has_matte
    assert mirror.shape.is_mirror


def test_another_paint_of_the_same_build_compiles_nothing_anew(asymmetric_environment):
    light = load_environment(EnvironmentConfig(file=asymmetric_environment)).emitter()

    def block(red, seed):
        bsdf = mi.load_dict(
            {"type": "roughplastic", "alpha": 0.1, "diffuse_reflectance": {"type": "rgb", "value": [red, 0.2, 0.2]}}
        )
        made = SphereIntegrator(light, bsdf, 16, LobeSplit.of(bsdf))
        return made.block(np.eye(3), 4, np.random.SeedSequence(seed))

    block(0.5, 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        block(0.6, 2)
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert all(kernel["cache_hit"] for kernel in launched)
