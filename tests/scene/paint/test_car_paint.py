"""Car paint: conservation, reciprocity, components, sampling, and agreement with real layers."""

from __future__ import annotations

import re

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain
from scipy.integrate import quad

from rsibr import backend
from rsibr.baking.integrator import SphereIntegrator
from rsibr.errors import InputError
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.scene.paint.car_paint import COAT, FLAKES, PIGMENT, PLUGIN, RETRO, register
from rsibr.scene.paint.pigments import pigment_reflectance
from tests.arrays import unit_vectors

RICH = {"flake_density": 3000.0, "flake_tint": 0.8, "retro_share": 0.3, "coat_alpha": 0.05}
"""A paint that has everything."""

COSINES = (1.0, 0.7, 0.3, 0.1, 0.01, 1e-4)


def rgb(*values):
    return {"type": "rgb", "value": list(values)}


def paint(**parameters):
    return mi.load_dict({"type": PLUGIN, **parameters})


def density(coverage, size):
    """Flakes of `size` [µm] per mm² that cover a given share."""
    return -np.log1p(-coverage) / (np.pi / 4 * (size * 1e-3) ** 2)


def tilted(cosine, azimuth=0.0):
    """Direction at `cosine` to the normal."""
    sine = np.sqrt(1 - np.square(cosine))
    parts = sine * np.cos(azimuth), sine * np.sin(azimuth), cosine
    return mi.Vector3f(*(np.asarray(p, dtype=np.float32) if np.ndim(p) else float(p) for p in parts))


def interaction(wi):
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wi))
    si.wi = wi
    return si


def upper(rng, count):
    vectors = unit_vectors(rng, count)
    return mi.Vector3f(*(vectors * np.sign(vectors[:, 2:])).astype(np.float32).T)


def albedo(bsdf, cosine, component=None, count=1 << 16):
    """Directional albedo by BSDF sampling, and its standard error."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, count)
    context = mi.BSDFContext()
    if component is not None:
        context.component = component
    wi = tilted(np.full(count, cosine))
    _, weight = bsdf.sample(context, interaction(wi), sampler.next_1d(), sampler.next_2d())
    weight = np.array(weight, dtype=np.float64)
    assert np.isfinite(weight).all()
    return weight.mean(axis=1), weight.std(axis=1) / np.sqrt(count)


# ------------------------------------------------------------------- closed forms


def fresnel(cosine, eta):
    inner = np.sqrt(1 - (1 - cosine**2) / eta**2)
    return (
        ((cosine - eta * inner) / (cosine + eta * inner)) ** 2 + ((eta * cosine - inner) / (eta * cosine + inner)) ** 2
    ) / 2


@pytest.mark.parametrize(("eta", "reflectance", "depth"), [(1.5, 0.8, 0.0), (1.3, 0.3, 0.0), (1.5, 1.0, 0.4)])
def test_pigment_below_a_smooth_coat_has_a_closed_form(eta, reflectance, depth):
    """ρ/π · T(ω_i) T(ω_o) / (η² (1 − ρK)), T = (1 − F) exp(−τ/cos θ'), K = 2 ∫ F_inner exp(−2τ/μ) μ dμ."""

    def returned(mu):
        outer = 1 - eta**2 * (1 - mu**2)
        inside = 1.0 if outer <= 0 else fresnel(np.sqrt(outer), eta)
        return 2 * inside * np.exp(-2 * depth / mu) * mu

    def transmitted(cosine):
        return (1 - fresnel(cosine, eta)) * np.exp(-depth / np.sqrt(1 - (1 - cosine**2) / eta**2))

    critical = np.sqrt(1 - 1 / eta**2)
    trapped = quad(returned, 0, critical)[0] + quad(returned, critical, 1)[0]
    bsdf = paint(
        pigment=reflectance, int_ior=eta, coat_alpha=0.0, coat_thickness=1000.0, coat_absorption=rgb(*[depth] * 3)
    )
    cos_i, cos_o = np.array([1.0, 0.8, 0.3, 0.02]), np.array([0.9, 0.4, 0.05, 0.5])
    wi, wo = tilted(cos_i), tilted(cos_o)
    found = np.array(bsdf.eval(mi.BSDFContext(), interaction(wi), wo))[0] / cos_o
    exact = reflectance / np.pi * transmitted(cos_i) * transmitted(cos_o) / (eta**2 * (1 - reflectance * trapped))
    np.testing.assert_allclose(found, exact, rtol=3e-4)


@pytest.mark.parametrize("coat_alpha", [0.0, 0.015, 0.1, 0.3])
def test_white_pigment_reflects_all(coat_alpha):
    """White furnace, at all angles: the standard error is below 0.1 %, the bound 5 of them wide and 0.05 % more."""
    bsdf = paint(pigment=1.0, coat_alpha=coat_alpha)
    for cosine in COSINES:
        value, error = albedo(bsdf, cosine)
        assert (np.abs(value - 1) < 5 * error + 5e-4).all()


@pytest.mark.parametrize(
    "parameters",
    [
        {"flake_density": 1e6},
        {"flake_density": 5000.0, "flake_size": 40.0},
        {"flake_density": 2000.0, "flake_size": 80.0, "coat_alpha": 0.0},
        {"flake_density": 3000.0, "flake_size": 5.0, "retro_share": 0.7},
        {"retro_share": 1.0, "retro_alpha": 0.05},
    ],
)
def test_never_more_than_all(parameters):
    """Flakes and pigment that absorb nothing: what microfacets shadow is lost, and nothing is gained."""
    bsdf = paint(pigment=1.0, flake_tint=1.0, **parameters)
    for cosine in COSINES:
        value, error = albedo(bsdf, cosine)
        assert (value < 1 + 5 * error + 5e-4).all()
        assert (value > 0.3).all()


def test_coat_without_paint_is_fresnel():
    bsdf = paint(pigment=0.0, coat_alpha=0.0)
    for cosine in COSINES:
        value, error = albedo(bsdf, cosine)
        assert (np.abs(value - fresnel(cosine, 1.5)) < 5 * error + 1e-5).all()


def test_pigments_are_those_of_the_chart():
    """White, black and neutral patches: the published Y of the 1976 chart, 90.0, 3.1 and 19.8 %; charts differ."""
    for name, luminance in (("white 9.5 (.05 D)", 0.90), ("black 2 (1.5 D)", 0.031), ("neutral 5 (.70 D)", 0.198)):
        found = pigment_reflectance(name)
        assert found @ [0.2126, 0.7152, 0.0722] == pytest.approx(luminance, abs=0.015)
        assert np.ptp(found) < 0.03
    red, green, blue = pigment_reflectance("red")
    assert red > 10 * max(green, blue)


def test_solid_red_is_the_charts_red():
    components = mi.traverse(load_material(MaterialConfig(preset="solid-red")).bsdf())
    np.testing.assert_allclose(np.array(components["pigment"]).ravel(), pigment_reflectance("red"), atol=5e-5)


# --------------------------------------------------------------------- structure


def test_reciprocal(rng):
    bsdf = paint(pigment=rgb(0.8, 0.3, 0.1), **RICH)
    a, b = upper(rng, 4096), upper(rng, 4096)
    there = bsdf.eval(mi.BSDFContext(), interaction(a), b) / b.z
    back = bsdf.eval(mi.BSDFContext(), interaction(b), a) / a.z
    np.testing.assert_allclose(np.array(there), np.array(back), rtol=2e-5)


def test_isotropic(rng):
    bsdf = paint(**RICH)
    a, b = upper(rng, 1024), upper(rng, 1024)
    turn = mi.Transform4f().rotate([0, 0, 1], 77)
    value = bsdf.eval(mi.BSDFContext(), interaction(a), b)
    turned = bsdf.eval(mi.BSDFContext(), interaction(turn @ a), turn @ b)
    np.testing.assert_allclose(np.array(value), np.array(turned), rtol=2e-3)  # float32 in the peak of the coat


def test_components_add_up(rng):
    bsdf = paint(pigment=rgb(0.8, 0.3, 0.1), **RICH)
    assert bsdf.component_count() == 4
    si, wo = interaction(upper(rng, 4096)), upper(rng, 4096)
    whole = np.array(bsdf.eval(mi.BSDFContext(), si, wo))
    parts = []
    for component in (PIGMENT, COAT, FLAKES, RETRO):
        context = mi.BSDFContext()
        context.component = component
        value, pdf = bsdf.eval_pdf(context, si, wo)
        assert (np.array(value).max(axis=1) > 0).all()
        np.testing.assert_array_equal(np.array(pdf), np.array(bsdf.pdf(context, si, wo)))
        parts.append(np.array(value, dtype=np.float64))
    np.testing.assert_allclose(sum(parts), whole, rtol=1e-6)

    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.Diffuse
    np.testing.assert_allclose(np.array(bsdf.eval(context, si, wo)), parts[PIGMENT], rtol=1e-6)
    context.type_mask = mi.BSDFFlags.Glossy
    np.testing.assert_allclose(np.array(bsdf.eval(context, si, wo)), whole - parts[PIGMENT], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("cosine", [1.0, 0.4, 0.05])
def test_albedos_of_components_add_up(cosine):
    bsdf = paint(pigment=0.6, **{**RICH, "coat_alpha": 0.0})
    whole, error = albedo(bsdf, cosine, count=1 << 18)
    parts, errors = zip(*(albedo(bsdf, cosine, k, count=1 << 18) for k in range(4)), strict=True)
    assert (np.abs(sum(parts) - whole) < 5 * np.sqrt(error**2 + sum(e**2 for e in errors)) + 1e-6).all()
    assert parts[COAT] == pytest.approx(fresnel(cosine, 1.5), abs=1e-5)


def test_smooth_coat_is_a_delta():
    smooth, rough = paint(coat_alpha=0.0), paint()
    assert mi.has_flag(smooth.flags(), mi.BSDFFlags.DeltaReflection)
    assert not mi.has_flag(rough.flags(), mi.BSDFFlags.Delta)
    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.Delta
    wi = mi.Vector3f(0.6, 0.0, 0.8)
    drawn, weight = smooth.sample(context, interaction(wi), 0.5, mi.Point2f(0.5, 0.5))
    np.testing.assert_allclose(np.array(drawn.wo).ravel(), [-0.6, 0, 0.8], rtol=1e-6)
    np.testing.assert_allclose(np.array(weight), fresnel(0.8, 1.5), rtol=1e-5)
    assert drawn.sampled_type[0] == int(mi.BSDFFlags.DeltaReflection)
    assert drawn.sampled_component[0] == COAT
    assert np.array(smooth.eval(context, interaction(wi), drawn.wo)).max() == 0


def test_retro_reflects_back():
    bsdf = paint(**RICH)
    context = mi.BSDFContext()
    context.component = RETRO
    wi = mi.Vector3f(0.6, 0, 0.8)
    toward = np.linspace(-1.2, 1.2, 241)
    wo = mi.Vector3f(np.sin(toward), 0, np.cos(toward))
    peak = toward[np.argmax(np.array(bsdf.eval(context, interaction(wi), wo))[0])]
    assert abs(peak - np.arcsin(0.6)) < 0.15


def test_grazing_and_below_are_finite(rng):
    """Hard case 23."""
    bsdf = paint(**RICH)
    heights = mi.Float([1e-8, 1e-6, 1e-3, 0.0, -0.3])
    for z in (1.0, 1e-3, 1e-6, 1e-8, 0.0, -0.5):
        wi = tilted(np.full(5, z))
        wo = mi.Vector3f(-dr.sqrt(1 - heights * heights), 0, heights)
        value, pdf = bsdf.eval_pdf(mi.BSDFContext(), interaction(wi), wo)
        drawn, weight = bsdf.sample(mi.BSDFContext(), interaction(wi), 0.7, mi.Point2f(0.3, 0.8))
        for found in (value, pdf, weight, drawn.pdf):
            assert np.isfinite(np.array(found)).all()
            assert (np.array(found) >= 0).all()
        assert np.array(weight).max() < 10
        if z <= 0:
            assert np.array(value).max() == np.array(weight).max() == 0
    assert np.array(value)[:, 3:].max() == 0


@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.15])
@pytest.mark.parametrize("component", [None, PIGMENT, COAT, FLAKES, RETRO])
def test_samples_follow_the_density(cosine, component):
    """χ² by Mitsuba's own harness, false-alarm rate 1 % for the 15 cases together (Šidák); fixed seed."""
    context = mi.BSDFContext()
    if component is not None:
        context.component = component
    plugin = {"type": PLUGIN, **RICH, "coat_alpha": 0.15}
    wi = [float(np.sqrt(1 - cosine**2)), 0.0, cosine]
    sample, pdf = BSDFAdapter(PLUGIN, plugin, wi=wi, ctx=context)
    quadrature = 16  # Mitsuba's own 4 err at grazing, for its own plugins too
    test = ChiSquareTest(SphericalDomain(), sample, pdf, sample_dim=3, ires=quadrature)
    assert test.run(significance_level=0.01, test_count=15, quiet=True)


# ----------------------------------------------------------------------- loading


def test_xml_is_the_same_as_the_dict(tmp_path):
    path = tmp_path / "paint.xml"
    path.write_text(
        f'<bsdf version="3.0.0" type="{PLUGIN}"><rgb name="pigment" value="0.1, 0.2, 0.3"/>'
        '<float name="flake_density" value="2000"/></bsdf>'
    )
    parameters = {"type": PLUGIN, "pigment": rgb(0.1, 0.2, 0.3), "flake_density": 2000.0}
    wi, wo = mi.Vector3f(0.6, 0, 0.8), mi.Vector3f(0, 0.6, 0.8)
    values = []
    for config in (MaterialConfig(file=path), MaterialConfig(bsdf=parameters)):
        material = load_material(config)
        assert material.warp == "mirror"
        values.append(np.array(material.bsdf().eval(mi.BSDFContext(), interaction(wi), wo)))
    np.testing.assert_array_equal(*values)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"flake_sise": 3.0}, "car paint has no 'flake_sise', only: pigment, "),
        ({"nested": {"type": "diffuse"}}, "car paint has no 'nested'"),
        ({"flake_size": 1.0}, "flake_size is 1, and may be 4 to 80"),
        ({"coat_absorption": rgb(0, -1, 0)}, "coat_absorption is 0, -1, 0, and may be 0 to 10000"),
        ({"coat_alpha": "rough"}, "coat_alpha is 'rough', and may only be a number"),
        ({"pigment": rgb(0, 0, 2)}, "Invalid RGB reflectance value [0, 0, 2], must be in the range [0, 1]"),
        (
            {"pigment": "moderate rad"},
            "no pigment 'moderate rad' (did you mean 'moderate red'?), only colours and: dark",
        ),
        ({"pigment": {"type": "checkerboard"}}, "'checkerboard' varies over the surface"),
    ],
)
def test_what_is_refused(parameters, message):
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        load_material(MaterialConfig(bsdf={"type": PLUGIN, **parameters}))
    assert "Traceback" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_parameters_can_be_changed_through_traverse():
    changed = paint(**RICH)
    parameters = mi.traverse(changed)
    parameters["pigment"] = mi.Color3f(0.1, 0.2, 0.3)
    parameters["flake_size"] = mi.Float(30.0)
    parameters.update()
    wi, wo = mi.Vector3f(0.6, 0, 0.8), tilted(0.7, 3.0)
    values = [
        np.array(bsdf.eval(mi.BSDFContext(), interaction(wi), wo))
        for bsdf in (changed, paint(pigment=rgb(0.1, 0.2, 0.3), **RICH, flake_size=30.0))
    ]
    np.testing.assert_allclose(*values, rtol=1e-6)


def test_nothing_is_compiled_from_paint_to_paint(gradient_sky):
    light = load_environment(EnvironmentConfig(file=gradient_sky)).emitter()
    first = paint(flake_density=1000.0)
    second = paint(flake_density=3000.0, coat_alpha=0.1, pigment=rgb(0.1, 0.7, 0.2), coat_absorption=rgb(1, 2, 3))
    SphereIntegrator(light, first, 16).block(np.eye(3), 16, np.random.SeedSequence(1))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        SphereIntegrator(light, second, 16).block(np.eye(3), 16, np.random.SeedSequence(2))
        launched = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
    assert launched
    assert all(kernel["cache_hit"] for kernel in launched)


@pytest.fixture
def other_variant():
    """Set another variant, and the usual one again afterwards."""

    def use(name):
        mi.set_variant(name)
        register()

    yield use
    backend.use()


@pytest.mark.parametrize("variant", ["llvm_ad_mono", "scalar_rgb", "llvm_ad_mono_polarized", "scalar_spectral"])
def test_other_variants_give_the_same_values(other_variant, variant):
    def value():
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi = tilted(0.8)
        found = paint(pigment=0.3, **RICH).eval(mi.BSDFContext(), si, tilted(0.7, 3.0))
        return np.array(found).ravel()[0]

    usual = value()
    other_variant(variant)
    assert value() == pytest.approx(usual, rel=1e-5)
