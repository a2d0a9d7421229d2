"""Physics of every preset: reciprocity, and no more light out than in; a BSDF of our own is one more line."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.scene.config import MaterialConfig
from rsibr.scene.material import load_material
from rsibr.scene.presets import PRESETS
from tests.arrays import to_numpy, unit_vectors, vector

SMOOTH = tuple(name for name in PRESETS if name != "mirror-silver")
"""Presets with a BRDF that can be evaluated; a perfect mirror is reciprocal by its Fresnel term alone."""

SAMPLED: dict[str, dict[str, Any]] = {
    "diffuse": {"type": "diffuse", "reflectance": 0.5},
    "roughconductor": {"type": "roughconductor", "material": "Al", "distribution": "ggx", "alpha": 0.1},
    "roughconductor, broad": {"type": "roughconductor", "material": "Al", "distribution": "ggx", "alpha": 0.5},
    "roughplastic": {"type": "roughplastic", "distribution": "ggx", "alpha": 0.2, "nonlinear": True},
    "principled": {
        "type": "principled",
        "base_color": {"type": "rgb", "value": [0.6, 0.02, 0.015]},
        "roughness": 0.4,
        "metallic": 0.5,
        "clearcoat": 1.0,
        "clearcoat_gloss": 0.2,
    },
}
"""BSDFs whose sampling is held against their density: the presets' models, no lobe too narrow for the grid."""

COSINES = (1.0, 0.7, 0.3, 0.1, 1e-2, 1e-4, 1e-6)


def upper(rng: np.random.Generator, count: int) -> np.ndarray:
    directions = unit_vectors(rng, count)
    directions[:, 2] = np.abs(directions[:, 2])
    return directions


def brdf(bsdf: mi.BSDF, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """f(wi, wo), shape (3, n): what Mitsuba evaluates, with its cosine divided out."""
    si = dr.zeros(mi.SurfaceInteraction3f, len(wi))
    si.wi = vector(wi)
    return to_numpy(bsdf.eval(mi.BSDFContext(), si, vector(wo))) / wo[:, 2]


@pytest.mark.parametrize("preset", SMOOTH)
def test_presets_are_reciprocal(preset, rng):
    """f(a, b) = f(b, a) to 1e-4 of its value, for all pairs of a hemisphere down to grazing; measured 4e-5.

    Mitsuba's principled model is no exception for metal and clear coat: its sheen, transmission and flatness, which
    no preset uses, are not tested here.
    """
    bsdf = load_material(MaterialConfig(preset=preset)).bsdf()
    a, b = upper(rng, 100_000), upper(rng, 100_000)
    forward, backward = brdf(bsdf, a, b), brdf(bsdf, b, a)
    assert np.isfinite(forward).all()
    assert (forward >= 0).all()
    assert np.abs(forward - backward).max(initial=0, where=forward > 0) > 0  # not the same number twice
    assert (np.abs(forward - backward) <= 1e-4 * np.maximum(forward, backward)).all()


def test_a_model_that_is_not_reciprocal_is_seen(rng):
    """The control: a normal map turns the light's cosine and not the viewer's."""
    tilted = mi.load_dict(
        {
            "type": "normalmap",
            "normalmap": {
                "type": "bitmap",
                "bitmap": mi.Bitmap(np.full((2, 2, 3), [0.8, 0.5, 0.8], np.float32)),
                "raw": True,
            },
            "bsdf": {"type": "diffuse"},
        }
    )
    a, b = upper(rng, 10_000), upper(rng, 10_000)
    si = dr.zeros(mi.SurfaceInteraction3f, len(a))
    si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.dp_du, si.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)

    def value(wi, wo):
        si.wi = vector(wi)
        return to_numpy(tilted.eval(mi.BSDFContext(), si, vector(wo))) / wo[:, 2]

    assert np.abs(value(a, b) - value(b, a)).max() > 0.1


@pytest.mark.parametrize("preset", PRESETS)
def test_no_preset_reflects_more_than_it_gets(preset):
    """Furnace: the directional albedo of 2^16 samples is at most 1 from every angle, at 5 standard errors (3e-7 each).

    The weight of a single sample may exceed 1 (1.1 for the clear coat): its mean may not.
    """
    bsdf = load_material(MaterialConfig(preset=preset)).bsdf()
    for cosine in COSINES:
        albedo, error = directional_albedo(bsdf, cosine)
        assert (albedo <= 1 + 1e-5 + 5 * error).all(), cosine
        assert (albedo > 0.01).all(), cosine


def test_albedos_are_those_of_the_closed_forms():
    """Lambert: its reflectance at every angle. GGX of alpha 1 with F = 1, at normal incidence: 1 − ln 2."""
    lambert = load_material(MaterialConfig(preset="matte-lambert")).bsdf()
    for cosine in COSINES:
        assert directional_albedo(lambert, cosine)[0] == pytest.approx(0.5, abs=1e-6)
    ggx = mi.load_dict({"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 1.0})
    albedo, error = directional_albedo(ggx, 1.0)
    assert (np.abs(albedo - (1 - math.log(2))) < 4 * error).all()


def directional_albedo(bsdf: mi.BSDF, cosine: float, count: int = 2**16) -> tuple[np.ndarray, np.ndarray]:
    """Mean weight of the BSDF's own samples, and its standard error; NaN samples are not left out."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(3, count)
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.wi = dr.repeat(mi.Vector3f(math.sqrt(1 - cosine**2), 0.0, cosine), count)
    _, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    weights = to_numpy(weight)
    return weights.mean(axis=1), weights.std(axis=1) / math.sqrt(count)


def chi_square(sampled: dict[str, Any], density: dict[str, Any], cosine: float) -> Any:
    """Mitsuba's test of one BSDF's samples against the density of another, over the upper hemisphere.

    Mitsuba's `roughplastic` has a density below the horizon as well, where its value is zero: no estimator meets it.
    """
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    wi = [math.sqrt(1 - cosine**2), 0.0, cosine]
    sample, _ = BSDFAdapter(sampled["type"], sampled, wi=wi)
    _, pdf = BSDFAdapter(density["type"], density, wi=wi)
    return ChiSquareTest(
        domain=SphericalDomain(),
        sample_func=sample,
        pdf_func=lambda wo: dr.select(wo.z > 0, pdf(wo), 0),
        sample_dim=3,
        sample_count=10**6,
        res=100,  # even: no cell straddles the horizon
        ires=8,
    )


@pytest.fixture
def _elsewhere(tmp_path, monkeypatch):
    """Mitsuba writes the histogram of a failed test into the working folder."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("_elsewhere")
@pytest.mark.parametrize("cosine", [0.95, 0.5, 0.15])
@pytest.mark.parametrize("name", SAMPLED)
def test_sampling_follows_the_density(name, cosine):
    """Mitsuba's chi-square test; false-alarm rate 1e-4 for all of them together, Šidák's correction included."""
    test = chi_square(SAMPLED[name], SAMPLED[name], cosine)
    assert test.run(significance_level=1e-4, test_count=3 * len(SAMPLED), quiet=True), test.messages


@pytest.mark.usefixtures("_elsewhere")
def test_sampling_that_does_not_follow_is_seen():
    """The control: samples of one roughness against the density of another."""
    broad = SAMPLED["roughconductor, broad"]
    assert not chi_square({**broad, "alpha": 0.45}, broad, 0.8).run(significance_level=1e-4, quiet=True)
