"""Spectra in configs: all ways to give one are read, and black bodies are what Mitsuba makes of them."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.spectra import found_metals, found_spectra, in_every_variant, planckian

PAIRS = [(400.0, 0.1), (500.0, 0.4), (700.0, 0.3)]


def written(tmp_path):
    file = tmp_path / "values.spd"
    file.write_text("".join(f"{wavelength} {value}\n" for wavelength, value in PAIRS))
    return str(file)


@pytest.mark.parametrize(
    "given",
    [
        {"type": "spectrum", "value": [[400, 0.1], [500, 0.4], [700, 0.3]]},
        {"type": "irregular", "wavelengths": "400, 500, 700", "values": "0.1, 0.4, 0.3"},
        {"type": "spectrum", "filename": written},
    ],
    ids=["table", "irregular", "file"],
)
def test_a_spectrum_is_found_however_it_is_given(given, tmp_path):
    given = {key: value(tmp_path) if callable(value) else value for key, value in given.items()}
    ((name, samples),) = found_spectra({"type": "twosided", "inner": {"type": "diffuse", "reflectance": given}}, "here")
    assert name == "reflectance"
    np.testing.assert_allclose(samples, PAIRS, rtol=1e-6)


def test_a_regular_spectrum_is_found():
    given = {"type": "regular", "wavelength_min": 400.0, "wavelength_max": 700.0, "values": "1, 2, 3, 4"}
    assert list(found_spectra({"type": "constant", "radiance": given}, "here")) == [
        ("radiance", [(400.0, 1.0), (500.0, 2.0), (600.0, 3.0), (700.0, 4.0)])
    ]


def test_named_pigments_and_metals_are_found(tmp_path):
    paint = {"type": "rsibr_car_paint", "pigment": "red"}
    ((name, samples),) = found_spectra(paint, "here")
    assert name == "red"
    assert dict(samples)[640.0] > 5 * dict(samples)[450.0]
    file = tmp_path / "metal.xml"
    file.write_text('<bsdf version="3.0.0" type="roughconductor"><string name="material" value="Au"/></bsdf>')
    assert list(found_metals(file)) == ["Au"]
    assert list(found_metals({"type": "conductor", "material": "none"})) == []


@pytest.mark.parametrize("wrong", [{"type": "spectrum", "value": [1, 2]}, {"type": "blackbody", "temperature": "hot"}])
def test_a_spectrum_that_is_none_is_refused(wrong):
    with pytest.raises(InputError, match="holds a spectrum that is none"):
        list(found_spectra({"type": "constant", "radiance": wrong}, "here"))


@pytest.mark.parametrize("temperature", [2000.0, 6500.0])
def test_a_black_body_is_mitsubas(temperature):
    with backend.rendering("spectral"):
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wavelengths = mi.UnpolarizedSpectrum(400.0, 500.0, 600.0, 700.0)
        light = {"type": "constant", "radiance": {"type": "blackbody", "temperature": temperature}}
        expected = np.array(mi.load_dict(light).eval(si)).ravel()
        found = np.array(mi.load_dict(in_every_variant(light, "here")).eval(si)).ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    np.testing.assert_allclose(
        [dict(planckian(temperature))[w] for w in (400.0, 500.0, 600.0, 700.0)], expected, rtol=1e-4
    )


def test_a_black_body_lights_a_scene_in_rgb_too():
    """Yellowish at 3000 K, bluish at 20 000 K."""

    def colour(temperature):
        config = EnvironmentConfig(
            emitter={"type": "constant", "radiance": {"type": "blackbody", "temperature": temperature}}
        )
        return np.array(
            mi.load_dict(load_environment(config).emitter()).eval(dr.zeros(mi.SurfaceInteraction3f))
        ).ravel()

    assert colour(3000.0)[0] > 2 * colour(3000.0)[2]
    assert colour(20000.0)[2] > 1.2 * colour(20000.0)[0]
