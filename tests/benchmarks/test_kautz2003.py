"""Filtering a new environment for `kautz2003`; the paper quotes 2 ms for the coefficients on an Athlon of 1 GHz."""

import drjit as dr
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.light.harmonic_irradiance import HarmonicIrradiance
from rsibr.lobes.band_factors import phong
from rsibr.methods.kautz2003.faces import averaged, box_levels
from rsibr.methods.kautz2003.kautz2003 import Kautz2003
from rsibr.methods.kautz2003.kautz_light import KautzLight
from rsibr.methods.kautz2003.material_fit import KautzMaterial, Lobes, schlick_mix
from rsibr.methods.kautz2003.nine_coefficients import FACE, coefficients
from tests.arrays import unit_vectors
from tests.benchmarks.turns import in_turns, report

PAPER_SECONDS = 2e-3
ROUNDS, MAP = 30, 256


@pytest.fixture
def faces(rng):
    """Radiance of 256² texels a face."""
    return rng.random((6, 256, 256, 3), dtype=np.float32)


@pytest.mark.benchmark(group="a new environment")
def test_nine_coefficients(benchmark, faces):
    """From faces of 8², as in the paper, to the device; beside them from 256², which are averaged first."""
    small = averaged(faces, FACE)
    contenders = {
        "ours": lambda _: HarmonicIrradiance.of(coefficients(small)),
        "on the host alone": lambda _: coefficients(small),
        "from 256²": lambda _: HarmonicIrradiance.of(coefficients(faces)),
    }
    seconds = in_turns(contenders, rounds=ROUNDS)
    benchmark.pedantic(lambda: contenders["ours"](0), rounds=ROUNDS)
    of_paper = float(np.median(seconds["ours"])) / PAPER_SECONDS
    report(benchmark, "nine coefficients from faces of 8²", seconds, of_the_papers_time=of_paper)


@pytest.mark.benchmark(group="a new environment")
@pytest.mark.parametrize("size", [64, 128, 256])
def test_a_new_environment_in_each_frame(benchmark, faces, size, rng):
    """Coefficients and box-filtered levels, to the device; then a map of 256² from a new view."""
    light = averaged(faces, size)
    made = _method(light)
    frames = [view_frame(v) for v in unit_vectors(rng, ROUNDS + 1)]

    def frame(method, turn):
        dr.eval(method.map(frames[turn % len(frames)], MAP))
        dr.sync_thread()

    contenders = {
        "ours": lambda _: made.refiltered(light),
        "filtered across borders": lambda _: KautzLight.of(light, borders=True),
        "levels on the host alone": lambda _: box_levels(light),
        "a map": lambda turn: frame(made, turn),
        "refiltered, and a map": lambda turn: frame(made.refiltered(light), turn),
    }
    seconds = in_turns(contenders, rounds=ROUNDS)
    benchmark.pedantic(lambda: contenders["ours"](0), rounds=ROUNDS)
    report(benchmark, f"refilter, faces of {size}²", seconds)


def _method(faces):
    fresnel = schlick_mix(np.full(3, 0.1))
    material = KautzMaterial.fitted(Lobes(0.5 * (1 - fresnel), fresnel, phong(225.0)), faces.shape[1])
    return Kautz2003(material, KautzLight.of(faces), {})
