"""What a fit finds in materials whose lobes are known: how many, of what kind, and how wide."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes import fit
from rsibr.lobes.basis import LAMBERT
from rsibr.lobes.fit import ALL_BUT_MATTE, LEAST_SHARE, MOST_GLOSSY, fit_lobes
from rsibr.scene.config import MaterialConfig
from rsibr.scene.material import load_material

PRESETS = [
    "candy-red",
    "clearcoat-red",
    "glossy-plastic",
    "matte-lambert",
    "metallic-blue",
    "metallic-silver",
    "pearl-white",
    "rough-aluminium",
    "solid-red",
]


@pytest.fixture(scope="module")
def fits():
    made = {}

    def fit(name):
        if name not in made:
            made[name] = fit_lobes(load_material(MaterialConfig(preset=name)).bsdf())
        return made[name]

    return fit


def kinds(lobes):
    return ["matte" if lobe.is_matte else "glossy" for lobe in lobes]


def energy(lobe, term):
    """Sum of the coefficients of one basis function: 0 plain, 1 grazing, 2 coated."""
    return sum(float(c[term].sum()) for c in lobe.coefficients if len(c) > term)


@pytest.mark.parametrize("name", PRESETS)
def test_there_are_at_most_two_glossy_lobes_the_widest_first(fits, name):
    lobes = fits(name)
    glossy = [lobe.alpha for lobe in lobes if not lobe.is_matte]
    assert 1 <= len(lobes) <= MOST_GLOSSY + 1
    assert len(glossy) <= MOST_GLOSSY
    assert kinds(lobes) == sorted(kinds(lobes), reverse=True)  # matte before glossy
    assert all(c.min() >= 0 for lobe in lobes for c in lobe.coefficients)
    assert len(set(np.concatenate([lobe.alphas for lobe in lobes]))) == sum(len(lobe.alphas) for lobe in lobes)


def test_a_red_clear_coat_is_coat_gloss_and_base(fits):
    lobes = fits("clearcoat-red")
    assert sorted(kinds(lobes)) == ["glossy", "glossy", "matte"]
    narrow, wide = sorted(lobe.alpha for lobe in lobes if not lobe.is_matte)
    assert narrow < 0.04
    assert wide > 3 * narrow


def test_a_metallic_paint_has_its_flakes_apart_from_its_coat_and_under_it(fits):
    glossy = sorted((lobe for lobe in fits("metallic-blue") if not lobe.is_matte), key=lambda lobe: lobe.alpha)
    coat, flakes = glossy
    assert coat.alpha < 0.05
    assert energy(coat, 2) == 0
    assert flakes.alpha > 0.15
    assert energy(flakes, 2) > 3 * (energy(flakes, 0) + energy(flakes, 1))


def test_a_metal_is_one_bare_lobe_of_its_roughness():
    (lobe,) = fit_lobes(mi.load_dict({"type": "roughconductor", "material": "Al", "alpha": 0.2, "distribution": "ggx"}))
    assert lobe.alpha == pytest.approx(0.2, rel=0.15)
    assert energy(lobe, 0) > 5 * energy(lobe, 2)


def test_two_metals_of_unlike_roughness_are_two_lobes():
    rough, smooth = (
        {"type": "roughconductor", "material": "none", "alpha": a, "distribution": "ggx"} for a in (0.3, 0.02)
    )
    lobes = fit_lobes(mi.load_dict({"type": "blendbsdf", "weight": 0.5, "a": rough, "b": smooth}))
    assert [lobe.alpha for lobe in lobes if not lobe.is_matte] == pytest.approx([0.3, 0.02], rel=0.25)


def three_metals():
    one, two, three = (
        {"type": "roughconductor", "material": "none", "alpha": a, "distribution": "ggx"} for a in (0.3, 0.1, 0.01)
    )
    half = {"type": "blendbsdf", "weight": 0.5, "a": one, "b": two}
    return mi.load_dict({"type": "blendbsdf", "weight": 0.4, "a": half, "b": three})


def test_each_of_three_metals_that_are_told_apart_has_a_lobe():
    assert [lobe.alpha for lobe in fit_lobes(three_metals())] == pytest.approx([0.3, 0.1, 0.01], rel=0.3)


def test_a_third_metal_in_a_black_box_joins_its_nearest_neighbour(monkeypatch):
    monkeypatch.setattr(fit, "told_apart", lambda *_: [])
    lobes = fit_lobes(three_metals())
    glossy = [lobe for lobe in lobes if not lobe.is_matte]
    assert len(glossy) == 2
    assert min(glossy[0].alphas) < 0.13 < max(glossy[0].alphas)
    assert glossy[1].alpha == pytest.approx(0.01, rel=0.3)


def test_what_mends_a_matte_base_is_no_lobe_of_its_own():
    """The base under a smooth coat is dimmed by Fresnel's terms, the stand-in by Schlick's: a wide lobe mends it."""
    (lobe,) = fit_lobes(mi.load_dict({"type": "plastic", "diffuse_reflectance": 0.5}))
    assert lobe.is_matte
    assert lobe.alpha == LAMBERT
    assert all(alpha >= ALL_BUT_MATTE[0] for alpha in lobe.alphas[1:])


def test_a_trace_of_a_lobe_does_not_get_a_layer():
    strong = {"type": "roughconductor", "material": "none", "alpha": 0.1, "distribution": "ggx"}
    faint = {"type": "diffuse", "reflectance": 0.5}
    lobes = fit_lobes(mi.load_dict({"type": "blendbsdf", "weight": 0.4 * LEAST_SHARE, "a": strong, "b": faint}))
    assert kinds(lobes) == ["glossy"]


def test_a_black_material_is_one_lobe():
    (lobe,) = fit_lobes(mi.load_dict({"type": "diffuse", "reflectance": 0.0}))
    assert energy(lobe, 0) == 0
