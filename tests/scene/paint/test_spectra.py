"""Car paint in spectral rendering: at any wavelength it is the paint whose channels have that wavelength's values."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.scene.paint.car_paint import PLUGIN
from rsibr.scene.paint.pigments import pigment_spectrum
from rsibr.scene.paint.spectra import NODES
from tests.scene.paint.test_car_paint import rgb, tilted

AT = [450.0, 530.0, 560.0, 640.0]  # nodes: nothing is interpolated between wavelengths
COATED = {"flake_density": 1500.0, "flake_size": 20.0, "coat_alpha": 0.1, "retro_share": 0.2}


def curve(low, high):
    return {"type": "spectrum", "value": [(360.0, low), (560.0, high), (830.0, (low + high) / 2)]}


def read(spectrum):
    pairs = np.array(spectrum["value"])
    return np.interp(AT, pairs[:, 0], pairs[:, 1])


def value(kind, parameters, wi, wo):
    """f·cos of a paint; in spectra at the wavelengths `AT`."""
    with backend.rendering(kind):
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi = wi
        if kind != "rgb":
            si.wavelengths = mi.UnpolarizedSpectrum(AT)
        found = mi.load_dict({"type": PLUGIN, **parameters}).eval(mi.BSDFContext(), si, wo)
        return np.array(mi.unpolarized_spectrum(found), dtype=np.float64).ravel()


@pytest.mark.parametrize("kind", ["spectral", "spectral_polarized"])
@pytest.mark.parametrize("out", [(0.7, 3.0), (0.75, 0.4), (0.15, 2.0)], ids=["mirror", "retro", "grazing"])
def test_a_spectral_paint_is_a_paint_in_rgb_at_each_wavelength(kind, out):
    spectra = {"pigment": curve(0.05, 0.6), "flake_tint": curve(0.3, 0.95), "coat_absorption": curve(12.0, 1.0)}
    found = value(kind, {**spectra, **COATED}, tilted(0.8), tilted(*out))
    for k in range(len(AT)):
        flat = {name: rgb(*[read(spectrum)[k]] * 3) for name, spectrum in spectra.items()}
        expected = value("rgb", {**flat, **COATED}, tilted(0.8), tilted(*out))[0]
        assert found[k] == pytest.approx(expected, rel=3e-3)  # some of the tables hold a sum of few functions


@pytest.mark.slow
def test_a_grey_paint_is_grey_at_every_wavelength():
    found = value("spectral", {"pigment": 0.3, **COATED}, tilted(0.8), tilted(0.7, 3.0))
    np.testing.assert_allclose(
        found, value("rgb", {"pigment": 0.3, **COATED}, tilted(0.8), tilted(0.7, 3.0))[0], rtol=1e-3
    )


@pytest.mark.slow
def test_a_measured_pigment_is_its_spectrum():
    measured = {
        "type": "spectrum",
        "value": list(zip(NODES.tolist(), pigment_spectrum("moderate red", NODES).tolist(), strict=True)),
    }
    by_name, by_value = (
        value("spectral", {"pigment": one}, tilted(0.8), tilted(0.4, 2.0)) for one in ("moderate red", measured)
    )
    np.testing.assert_allclose(by_name, by_value, rtol=1e-4)
    assert by_name[3] > 2 * by_name[0]  # red


@pytest.mark.parametrize("kind", ["spectral", "spectral_polarized"])
def test_what_is_sampled_adds_up_to_what_is_evaluated(kind):
    """Directional albedo at four wavelengths by BSDF samples and by a cosine lobe; z-test, false alarm below 1e-4."""
    count = 2**16
    with backend.rendering(kind):
        paint = mi.load_dict({"type": PLUGIN, "pigment": curve(0.05, 0.6), "flake_tint": curve(0.3, 0.95), **COATED})
        u = mi.PCG32(size=count)
        si = dr.zeros(mi.SurfaceInteraction3f, count)
        si.wi = tilted(0.8)
        si.wavelengths = mi.UnpolarizedSpectrum(AT)
        context = mi.BSDFContext()
        _, weight = paint.sample(context, si, u.next_float32(), mi.Point2f(u.next_float32(), u.next_float32()))
        wo = mi.warp.square_to_cosine_hemisphere(mi.Point2f(u.next_float32(), u.next_float32()))
        by_cosine = mi.unpolarized_spectrum(paint.eval(context, si, wo)) / (wo.z * dr.inv_pi)
        one, two = (np.array(values, dtype=np.float64) for values in (mi.unpolarized_spectrum(weight), by_cosine))
    error = np.sqrt((one.var(axis=1) + two.var(axis=1)) / count)
    assert np.abs((one.mean(axis=1) - two.mean(axis=1)) / error).max() < 4.5
    assert one.mean(axis=1)[2] > 1.5 * one.mean(axis=1)[0]
