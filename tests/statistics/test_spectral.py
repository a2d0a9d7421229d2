"""Maps in spectra and with polarisation: against sums over wavelengths by hand, and against Mitsuba's own path tracer.

Each test has a false-alarm rate of 1e-4: texels, blocks and the aggregate apart, Šidák's correction included.
"""

from __future__ import annotations

import colour
import numpy as np
import pytest

from rsibr import backend
from rsibr.baking.blocks import block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.lobes.split import LobeSplit
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.validation.reference import render_reference
from tests.planning.metamers import GRID, light, lines, matte, metamers, seen_of
from tests.statistics.comparison import compared
from tests.statistics.failures import kept_on_failure

N = 32
BLOCKS = 16
LEVEL = 1e-4
SAMPLES = 1024

GOLD = {"type": "roughconductor", "material": "Au", "alpha": 0.2}
POLARISING = {"type": "pplastic", "alpha": 0.15, "diffuse_reflectance": {"type": "rgb", "value": [0.5, 0.1, 0.05]}}
TWO = {"type": "blendbsdf", "weight": 0.4, "one": GOLD, "two": matte(metamers()[1])}


def baked_view(environment, material, kind, seed=11):
    """One view, its lobes kept apart."""
    split = LobeSplit.of(material.bsdf())
    with backend.rendering(kind):
        integrator = SphereIntegrator(environment.emitter(), material.bsdf(), N, split)
    return bake_view(integrator, view_frame([0.2, 0.5, 0.8]), block_sizes(SAMPLES), seed=seed, index=0)


def difference(one, two):
    """The three tests of a map and its variance against another."""
    judged = one[2] > 0.99
    return compared(one[0], one[1], two[0], two[1], judged, BLOCKS - 1)


def of_map(baked):
    return baked.radiance, baked.variance, baked.coverage


def courtyard():
    return load_environment(EnvironmentConfig(file=scenes() / "environments" / "courtyard.exr"))


def named(material):
    return load_material(MaterialConfig(**({"preset": material} if isinstance(material, str) else {"bsdf": material})))


def cases():
    """Each material in both variants; the fast ones have each lobe kind and each variant."""
    fast = {("coat", "spectral"), ("gold", "spectral"), ("pplastic", "spectral_polarized")}
    materials = {"coat": "clearcoat-red", "paint": "candy-red", "gold": GOLD, "pplastic": POLARISING, "two": TWO}
    for kind in ("spectral", "spectral_polarized"):
        for name, material in materials.items():
            marks = () if (name, kind) in fast else pytest.mark.slow
            yield pytest.param(kind, material, marks=marks, id=f"{name}-{kind}")


@pytest.mark.parametrize(("kind", "material"), list(cases()))
def test_bake_agrees_with_the_path_tracer(kind, material):
    environment, material = courtyard(), named(material)
    baked = baked_view(environment, material, kind)
    frame = view_frame([0.2, 0.5, 0.8])
    reference = render_reference(environment, material, frame, N, SAMPLES, seed=12, buffers=BLOCKS, rendering=kind)
    found = difference(of_map(baked), (reference.mean, reference.variance_of_mean))
    pictures = {"image": baked.radiance, "reference": reference.mean, "p_values": found.p_values}
    with kept_on_failure(f"spectral_{kind}_{material.name}", **pictures):
        assert min(found.texel, found.block, found.aggregate) > LEVEL


@pytest.mark.parametrize("material", [GOLD, POLARISING], ids=["gold", "pplastic"])
def test_unpolarised_light_keeps_its_intensity_with_polarisation(material):
    """One reflection: the first Stokes parameter knows nothing of the others."""
    environment, material = courtyard(), named(material)
    off, on = (
        baked_view(environment, material, kind, seed) for kind, seed in (("spectral", 3), ("spectral_polarized", 4))
    )
    found = difference(of_map(off), of_map(on))
    assert min(found.texel, found.block, found.aggregate) > LEVEL


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("lamp", ["lines", "FL11", "A"])
def test_a_matte_spectrum_under_an_even_light_has_the_colour_of_its_sum(which, lamp):
    """ρ(λ) S(λ) summed over wavelengths at 1 nm by the observer of colour-science."""
    emission = (
        lines(436, 546, 611) if lamp == "lines" else colour.SDS_ILLUMINANTS[lamp].copy().align(shape()).values / 100
    )
    reflectance = metamers()[which]
    environment = load_environment(EnvironmentConfig(emitter=light(emission)))
    baked = baked_view(environment, named(matte(reflectance)), "spectral")
    judged = baked.coverage > 0.99
    expected = np.broadcast_to(seen_of(emission, reflectance), baked.radiance.shape)
    rounding = np.full_like(baked.variance, (1e-4 * expected.max()) ** 2)  # Mitsuba has its observer at 5 nm
    found = compared(baked.radiance, baked.variance, expected, rounding, judged, BLOCKS - 1)
    assert min(found.texel, found.block) > LEVEL
    means = baked.radiance[judged].mean(axis=0), expected[judged].mean(axis=0)
    error = np.sqrt(baked.variance[judged].sum(axis=0)) / judged.sum() + 1e-4 * expected.max()
    assert (np.abs(means[0] - means[1]) < 4.5 * error).all()


def shape():
    return colour.SpectralShape(GRID[0], GRID[-1], GRID[1] - GRID[0])


def test_rgb_errs_by_what_was_predicted_of_a_metamer_and_spectra_do_not():
    """RelMSE of the RGB map against the sum by hand, and the mismatch that a plan measures: within 10 %."""
    from rsibr.planning.metamerism import rgb_mismatch

    emission, reflectance = lines(436, 546, 611), metamers()[1]
    environment = load_environment(EnvironmentConfig(emitter=light(emission)))
    truth = seen_of(emission, reflectance)

    def error(kind):
        baked = baked_view(environment, named(matte(reflectance)), kind)
        found = baked.radiance[baked.coverage > 0.99].mean(axis=0)
        return ((found - truth) ** 2).mean() / (truth**2).mean()

    predicted = rgb_mismatch(matte(reflectance), light(emission)).rel_mse
    assert error("rgb") == pytest.approx(predicted, rel=0.1)
    assert error("spectral") < 1e-3 * predicted
