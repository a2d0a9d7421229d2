"""Fit of the paper's constants and weights to lobes."""

from dataclasses import replace

import numpy as np
import pytest

from rsibr.lobes.albedo import over_disk
from rsibr.lobes.facet_moments import cosines
from rsibr.lobes.probe_directions import ProbeDirections
from rsibr.lobes.shape_fit import shape_values
from rsibr.methods.miller1984.convolution import texel_areas
from rsibr.methods.miller1984.material_fit import MaterialFit, _probes
from rsibr.methods.miller1984.reflectance import VARNISH
from tests.methods.miller1984.scene import glossy, matte, mirror, polar_directions


def test_a_lobe_of_slopes_has_about_the_exponent_of_its_width():
    """Slopes of deviation σ turn reflections by 2σ, and by 2σ cos θ across: n = 1/4σ² cos θ, mean cosine 2/3."""
    for sigma in (0.02, 0.05):
        assert MaterialFit.of([glossy(sigma)]).n == pytest.approx(1.5 / (4 * sigma**2), rel=0.25)
    assert MaterialFit.of([glossy(0.02)]).n / MaterialFit.of([glossy(0.05)]).n == pytest.approx(6.25, rel=0.1)


def test_of_two_lobes_the_one_that_reflects_more_decides():
    """A faint sharp coat over a wide base: the exponent is that of the base, within a factor of a few."""
    base, coat = glossy(0.2, (0.5, 0.5, 0.5)), glossy(0.01, (0.04, 0.04, 0.04))
    alone, both = MaterialFit.of([base]).n, MaterialFit.of([base, coat]).n
    assert alone < both < 3 * alone
    assert MaterialFit.of([coat]).n > 100 * alone


def test_a_given_exponent_is_kept():
    assert MaterialFit.of([glossy(0.05)], n=3.0).n == 3.0


def constant_sky(material):
    """What the maps hold under a constant sky of radiance 1, times the weights."""
    s = material.mirror if np.isinf(material.n) else material.k_s / (2 * (material.n + 1)) + material.mirror
    return material.w_d * material.k_d / 4 + material.w_s * s


@pytest.mark.parametrize(
    "lobes",
    [
        [matte(0.8, 0.4, 0.0)],
        [glossy(0.1, (0.9, 0.5, 0.2))],
        [mirror((1, 0.5, 0.2))],
        [matte(0.5, 0.4, 0.3), glossy(0.05, (0.1, 0.1, 0.2))],
        [matte(0.5, 0.4, 0.3), glossy(0.05, (0.1, 0.1, 0.2)), mirror((0.04, 0.04, 0.04))],
        [glossy(0.05, (0.1, 0.1, 0.2)), glossy(0.2, (0.3, 0.1, 0.0))],
    ],
    ids=["matte", "glossy", "mirror", "plastic", "varnished", "two glossy"],
)
def test_a_constant_sky_gives_the_albedo(lobes):
    fit = MaterialFit.of(lobes)
    total = sum(
        np.interp(np.sqrt(cosines()), np.linspace(0, 1, 65), albedo[:, 0])[:, None] * albedo[-1] / albedo[-1, 0]
        if albedo[-1, 0]
        else np.zeros(3)
        for _, albedo in lobes
    )
    assert np.allclose(constant_sky(fit.material()), total, atol=1e-6)


def test_weights_have_the_mean_one_over_the_disk():
    material = MaterialFit.of([matte(0.5, 0.4, 0.3), glossy(0.05)]).material()
    assert np.allclose(over_disk(material.w_d, cosines()), 1)
    assert np.allclose(over_disk(material.w_s, cosines()), 1)


def test_a_delta_lobe_is_the_mirror_or_the_varnish():
    alone, over = MaterialFit.of([mirror()]).material(), MaterialFit.of([mirror(), glossy(0.1)]).material()
    assert np.isinf(alone.n)
    assert alone.mirror == 1
    assert over.mirror == VARNISH
    # The Phong part over the mirror part is as the albedos are
    assert np.allclose(over.k_s / (2 * (over.n + 1)) / VARNISH, 0.5, rtol=1e-3)


def test_a_channel_without_a_mirror_part_keeps_its_glossy_part():
    material = MaterialFit.of([mirror((1, 1, 0)), glossy(0.1)]).material()
    assert np.allclose(constant_sky(material)[-1], [0.9, 0.9, 0.3], rtol=1e-4)


def test_lambert_has_no_error_and_a_wrong_exponent_has_one():
    assert MaterialFit.of([matte(0.5, 0.4, 0.3)]).error < 3e-3
    fit = MaterialFit.of([glossy(0.05)])
    assert 0.05 < fit.errors.min() < 0.3
    assert replace(fit, n=10 * fit.n).error > 2 * fit.error
    assert replace(fit, n=fit.n / 10).error > 2 * fit.error
    assert len(fit.errors) == len(_probes().views)


def test_errors_are_integrals_over_the_whole_sphere():
    """Against a grid of directions: what a Phong lobe takes from below the horizon counts."""
    fit = MaterialFit.of([glossy(0.2)])
    wi = polar_directions(180).reshape(-1, 3)[:, [0, 2, 1]]  # the tables' +Y is the surface's normal +z
    area = texel_areas(180, 360)[:, 0, 0].repeat(360)
    above = wi[:, 2] > 0
    for wo, error in ((np.array([np.sqrt(1 - c * c), 0, c]), fit.errors[k]) for k, c in ((0, 0.98), (-1, 0.12))):
        probes = ProbeDirections(wi[above], np.tile(wo, (above.sum(), 1)), np.ones(above.sum()))
        f = np.zeros(len(wi))
        f[above] = shape_values(fit.lobes[0][0], probes)[:, 0]
        f /= (f * area).sum()
        phong = (fit.n + 1) / (2 * np.pi) * np.maximum(wi @ (wo * [-1, -1, 1]), 0) ** fit.n
        assert error == pytest.approx((np.abs(phong - f) * area).sum(), rel=0.03)


def test_the_probes_integrate_a_lobe():
    """∫ max(x, 0) dω/π = 1 at every angle, from draws of six densities."""
    probes = _probes()
    shape, _ = matte(1, 1, 1)
    values = shape_values(shape, probes) / probes.density[:, None]
    for view in probes.views:
        assert values[view].sum(axis=0) / 512 == pytest.approx(np.ones(3), rel=0.01)
