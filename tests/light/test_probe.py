"""What is measured of the light, against closed forms."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.projections.latlong import MITSUBA
from rsibr.geometry.projections.sphere_image import texel_solid_angles
from rsibr.light.harmonics import LMAX, band_power, coefficients, reduced, synthesis
from rsibr.light.probe import SMALL, UNRESOLVED, probe_light
from tests.planning.scenes import UP, coloured, constant, gradient, sky, sun
from tests.scene.maps import latlong_directions


def probe(environment):
    return probe_light(environment.emitter(), environment.image)


def test_a_constant_sky_is_even_grey_and_of_band_zero():
    found = probe(constant(0.5))
    assert found.mean == pytest.approx((0.5, 0.5, 0.5), rel=1e-6)
    assert found.variance < 1e-9
    assert found.contrast == pytest.approx(1, rel=1e-6)
    assert found.peak_share == pytest.approx(SMALL, rel=1e-6)
    assert found.chroma < 1e-7
    assert found.bands[0] == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("slope", [0.2, 0.6, 0.95])
def test_a_gradient_has_its_closed_form(slope):
    """L = 1 + a·ω: ⟨L²⟩/⟨L⟩² − 1 = a²/3, all of it in band 1; the contrast is 1 + a."""
    found = probe(gradient(slope))
    assert found.variance == pytest.approx(slope**2 / 3, rel=1e-3)
    assert found.contrast == pytest.approx(1 + slope, rel=1e-5)
    assert found.bands[1] * (1 + found.variance) == pytest.approx(slope**2 / 3, rel=1e-3)
    assert found.bands[2:].sum() + found.beyond < 1e-4


def test_the_colour_of_light_is_its_difference_from_red():
    tinted = sky(lambda d: np.ones(d.shape[:2])[..., None] * [1.0, 1.0, 0.9])
    assert probe(tinted).chroma == pytest.approx(0.1, rel=1e-5)
    assert probe(coloured()).chroma > 0.1
    assert probe(sun()).chroma == 0


def test_a_small_source_is_seen_by_its_share_and_its_variance():
    """Of a cap of solid angle Ω and radiance s over a sky of 1: all its light is in the brightest thousandth."""
    found = probe(sun())
    directions = latlong_directions(129, 256)
    weight = texel_solid_angles(MITSUBA, (129, 256))[0]
    cap = weight[directions @ np.array([0.6, 0.8, 0.0]) > 0.9995].sum() / (4 * np.pi)
    mean = 1 + 1e4 * cap
    assert cap < SMALL
    assert found.peak_share == pytest.approx((SMALL + 1e4 * cap) / mean, rel=1e-4)
    assert found.variance == pytest.approx((1 + 2e4 * cap + 1e8 * cap) / mean**2 - 1, rel=1e-4)
    assert found.beyond > 0.5


def test_a_sun_that_slips_through_the_grid_is_found_by_the_emitters_own_sampling():
    sky_alone = probe_light({"type": "sunsky", "sun_scale": 0.0}, None)
    with_sun = probe_light({"type": "sunsky"}, None)
    assert sum(with_sun.mean) > 1.3 * sum(sky_alone.mean)
    assert with_sun.peak_share > 0.3
    assert with_sun.variance > 1e3
    assert sky_alone.variance < 10


def test_a_source_without_extent_is_unresolved():
    assert probe_light({"type": "directional", "direction": [0, -1, 0]}, None).variance == UNRESOLVED


def test_a_black_sky_is_black():
    assert probe(sky(lambda d: np.zeros(d.shape[:2]))).is_black
    assert not probe(gradient()).is_black


def test_a_large_map_is_measured_as_a_small_one():
    """The brightest texel counts at full size; means and bands do not depend on it."""

    def light(d):
        return 1 + 0.5 * (d @ UP) + 0.2 * d[..., 0] * d[..., 2]

    large, small = probe(sky(light, 2049, 4096)), probe(sky(light, 257, 512))
    assert large.variance == pytest.approx(small.variance, rel=1e-3)
    assert np.abs(large.bands - small.bands).max() < 1e-4


@pytest.mark.parametrize(("band", "order"), [(0, 0), (1, 1), (5, 3), (LMAX, 0), (LMAX, LMAX)])
def test_harmonics_come_back_from_their_map(band, order):
    spectrum = np.zeros((LMAX + 1, LMAX + 1), dtype=complex)
    spectrum[band, order] = 2.0 if order == 0 else 1.5 - 0.5j
    assert np.abs(coefficients(synthesis(spectrum)) - spectrum).max() < 1e-12
    power = abs(spectrum[band, order]) ** 2 * (1 if order == 0 else 2) / (4 * np.pi)
    assert band_power(spectrum)[band] == pytest.approx(power)
    image = synthesis(spectrum)
    weight = texel_solid_angles(MITSUBA, image.shape[:2])[0] / (4 * np.pi)
    assert (weight * image**2).sum() == pytest.approx(power, rel=1e-2)  # Parseval


def test_harmonics_point_where_mitsuba_points():
    """Band 1 of order 0 goes with +Y; a light at +X has its phase a quarter turn from one at −Z."""
    at_y, at_x, at_minus_z = (
        coefficients(np.exp(10 * (latlong_directions(128, 256) @ np.array(axis) - 1)))
        for axis in ([0, 1, 0], [1, 0, 0], [0, 0, -1])
    )
    assert at_y[1, 0].real > 10 * abs(at_y[1, 1])
    assert np.angle(at_x[1, 1] / at_minus_z[1, 1]) == pytest.approx(-np.pi / 2, abs=1e-6)


def test_reducing_keeps_means(rng):
    image = rng.random((40, 60, 3))
    small = reduced(image, 20, 30)
    assert small.shape == (20, 30, 3)
    assert small.mean(axis=1).max() < image.max()
    flat = np.full((41, 64, 1), 3.0)
    assert np.allclose(reduced(flat, 16, 16), 3.0)


def test_it_reads_what_mitsuba_reads(asymmetric_environment):
    """The mean radiance against Mitsuba's own sampling of the map: 5 sigma, a false alarm in 1e6."""
    image = np.array(mi.Bitmap(str(asymmetric_environment)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))
    emitter = mi.load_dict({"type": "envmap", "bitmap": mi.Bitmap(image)})
    scene = mi.load_dict({"type": "scene", "light": emitter})
    rng = np.random.default_rng(5)
    u = mi.Point2f(rng.random((2, 2**16)).astype(np.float32))
    _, weight = scene.sample_emitter_direction(dr.zeros(mi.Interaction3f, 2**16), u, False)
    drawn = np.array(weight).reshape(3, -1) / (4 * np.pi)
    error = 5 * drawn.std(axis=1) / np.sqrt(drawn.shape[1]) + 2e-3 * drawn.mean(axis=1)
    assert (np.abs(np.array(probe_light({}, image).mean) - drawn.mean(axis=1)) < error).all()
