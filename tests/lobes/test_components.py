"""Components that Mitsuba evaluates one at a time: told apart where they add up, and shared out exactly."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.integrator import SphereIntegrator
from rsibr.geometry.sphere_interaction import interaction
from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.bsdf_eval import reflected
from rsibr.lobes.components import component_shares, told_apart
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.split import LobeSplit
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.scene.paint.car_paint import COAT, FLAKES, PIGMENT
from tests.arrays import to_numpy, unit_vectors, vector

TWO_METALS = {
    "type": "blendbsdf",
    "weight": 0.3,
    "sharp": {"type": "roughconductor", "alpha": 0.1, "distribution": "ggx"},
    "wide": {"type": "roughconductor", "alpha": 0.5, "distribution": "ggx"},
}


def preset(name):
    return load_material(MaterialConfig(preset=name)).bsdf()


def directions(rng, count=3000):
    pair = [unit_vectors(rng, count) for _ in range(2)]
    for w in pair:
        w[:, 2] = np.abs(w[:, 2])
    return pair


def found(bsdf, rng):
    return told_apart(bsdf, *directions(rng), np.full(3000, 1 / (2 * np.pi)))


@pytest.mark.parametrize(
    ("bsdf", "components"),
    [
        ({"type": "roughplastic", "alpha": 0.1}, [0, 1]),
        (TWO_METALS, [0, 1]),
        ({"type": "diffuse"}, [0]),
        ({"type": "plastic"}, [1]),  # the other is a delta
        ({"type": "principled", "clearcoat": 1.0}, []),  # answers with all of itself whatever is asked
        ({"type": "blendbsdf", "weight": 0.5, "a": {"type": "diffuse"}, "b": {"type": "principled"}}, []),
        ({"type": "rsibr_car_paint", "flake_density": 3000.0}, [PIGMENT, COAT, FLAKES]),
        ({"type": "rsibr_car_paint"}, [PIGMENT, COAT]),  # no flakes: nothing, which needs no lobe
    ],
)
def test_components_are_told_apart_where_they_add_up(bsdf, components, rng):
    assert found(mi.load_dict(bsdf), rng) == components


@pytest.mark.parametrize("name", ["glossy-plastic", "pearl-white"])
def test_a_lobe_is_its_component_and_nothing_else(name, rng):
    """f·ω_k against Mitsuba's own answer for the component alone, to the rounding of a quotient."""
    bsdf = preset(name)
    split, (wi, wo) = LobeSplit.of(bsdf), directions(rng)
    whole = reflected(bsdf, wi, wo)
    shares = [to_numpy(share).T for share in split.shares(vector(wi), vector(wo))]
    values = {index: reflected(bsdf, wi, wo, index) for index in found(bsdf, rng)}
    assert len(shares) == len(values)
    for lobe, share in zip(split.lobes, shares, strict=True):
        assert np.abs(whole * share - values[lobe.proxy.component]).max() < 1e-6 * whole.max()


def test_lobes_of_two_metals_have_the_roughness_of_each():
    lobes = LobeSplit.of(mi.load_dict(TWO_METALS)).lobes
    assert [lobe.alpha for lobe in lobes] == pytest.approx([0.5, 0.1], rel=0.3)
    head_on = [lobe.albedo[-1, 0] for lobe in lobes]  # hard case 17: what GGX facets with F = 1 reflect of all light
    assert head_on == pytest.approx([0.3 * 0.68785, 0.7 * 0.9883], rel=2e-3)


def test_two_lobes_of_one_name_are_two_layers():
    matte = {"type": "diffuse", "reflectance": 0.5}
    split = LobeSplit.of(mi.load_dict({"type": "blendbsdf", "weight": 0.5, "a": matte, "b": matte}))
    assert split.names == ["diffuse", "diffuse-2"]
    assert sum(lobe.albedo for lobe in split.lobes)[-1] == pytest.approx(0.5, rel=2e-3)


def test_a_component_may_be_split_further_by_stand_ins(rng):
    bsdf, (wi, wo) = preset("glossy-plastic"), directions(rng)
    one = np.ones((1, 3))
    coat = [ProxyLobe((alpha,), (one,), component=0) for alpha in (0.05, 0.6)]
    base = ProxyLobe((LAMBERT,), (one,), component=1)
    matte, narrow, wide = (to_numpy(s).T for s in LobeSplit(bsdf, [base, *coat]).shares(vector(wi), vector(wo)))
    whole = reflected(bsdf, wi, wo)
    assert np.abs(whole * matte - reflected(bsdf, wi, wo, 1)).max() < 1e-6 * whole.max()
    assert np.abs(whole * (narrow + wide) - reflected(bsdf, wi, wo, 0)).max() < 1e-6 * whole.max()
    near_mirror = ((wi * [-1, -1, 1] * wo).sum(axis=1) > 0.999) & (wo[:, 2] > 0.3)
    assert near_mirror.any()
    assert (narrow > wide)[near_mirror].all()


def test_shares_of_components_are_safe_at_grazing_and_below(rng):
    wi, wo = directions(rng, 200)
    wi[:50, 2], wo[50:100, 2] = 1e-7, 1e-7
    wi[100:] *= [1, 1, -1]
    shares = component_shares(preset("glossy-plastic"), [0, 1], vector(wi), interaction(vector(wo)))
    values = np.array([to_numpy(share) for share in shares])
    assert np.isfinite(values).all()
    assert values.min() >= 0
    assert np.abs(values.sum(axis=0) - 1).max() < 1e-6


@pytest.mark.parametrize("kind", ["roughplastic", "rsibr_car_paint"])
def test_components_compile_nothing_anew_for_another_paint(kind, asymmetric_environment):
    light = load_environment(EnvironmentConfig(file=asymmetric_environment)).emitter()
    name = "diffuse_reflectance" if kind == "roughplastic" else "pigment"

    def block(red, seed):
        bsdf = mi.load_dict({"type": kind, name: {"type": "rgb", "value": [red, 0.2, 0.2]}})
        made = SphereIntegrator(light, bsdf, 16, LobeSplit.of(bsdf))
        return made.block(np.eye(3), 4, np.random.SeedSequence(seed))

    block(0.5, 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        block(0.6, 2)
        launched = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert launched
    assert all(kernel["cache_hit"] for kernel in launched)
