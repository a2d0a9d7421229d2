"""The synthetic `measured` material: the file is what its script writes, and Mitsuba reads its closed form from it."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.geometry.sphere_interaction import interaction
from rsibr.scene.config import MaterialConfig
from rsibr.scene.material import load_material
from tests.measured_file import load

measured = load()


@pytest.fixture(scope="module")
def bsdf():
    return load_material(MaterialConfig(bsdf={"type": "measured", "filename": str(measured.FILE)})).bsdf()


def directions(count: int, seed: int):
    """Directions of the upper hemisphere down to a cosine of 0.05; shape (3, count)."""
    generator = np.random.default_rng(seed)
    z, phi = generator.uniform(0.05, 1, count), generator.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - z**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z]).astype(np.float32)


def test_the_file_is_that_of_its_script():
    assert measured.tensor_file(measured.fields()) == measured.FILE.read_bytes()


@pytest.mark.parametrize("cosine", [1.0, 0.6, 0.2, 0.01])
def test_the_projected_area_is_that_of_the_normals(cosine):
    """∫ D(m) max(i·m, 0) dm, which is 1 head on: the normals cover the surface once."""
    z, phi = (np.arange(8000) + 0.5) / 8000, (np.arange(100) + 0.5) / 100 * np.pi
    sines = np.sqrt((1 - cosine**2) * (1 - z**2))
    facing = np.maximum(cosine * z[:, None] + sines[:, None] * np.cos(phi), 0).mean(axis=1)
    area = 2 * np.pi * np.mean(measured.normal_distribution(z) * facing)
    assert measured.projected_area(np.array(cosine)) == pytest.approx(area, rel=2e-3)


def test_mitsuba_reads_the_closed_form(bsdf):
    """F D G₁(i) G₁(o) / (4 cos θ_i), within what tables of 24² nodes hold."""
    i, o = directions(20_000, 0), directions(20_000, 1)
    half = (i + o) / np.linalg.norm(i + o, axis=0)
    spread = measured.normal_distribution(half[2]) * measured.masking(i[2]) * measured.masking(o[2]) / (4 * i[2])
    wanted = measured.reflectance((i * half).sum(axis=0)) * spread[:, None]
    found = np.array(bsdf.eval(mi.BSDFContext(), interaction(mi.Vector3f(i)), mi.Vector3f(o))).T
    assert np.median(np.abs(found / wanted - 1)) < 0.01
    assert found.sum() == pytest.approx(wanted.sum(), rel=0.02)


@pytest.mark.parametrize("cosine", [1.0, 0.7, 0.4, 0.1, 0.02])
def test_it_reflects_at_most_all_and_is_sampled_as_it_is(bsdf, cosine):
    """The mean weight of its samples is the sum of its values over the hemisphere."""
    count = 2**16
    view = mi.Vector3f(np.tile(np.array([[np.sqrt(1 - cosine**2)], [0], [cosine]], np.float32), count))
    u = np.random.default_rng(2).random((4, count)).astype(np.float32)
    context, si = mi.BSDFContext(), interaction(view)
    _, weight = bsdf.sample(context, si, mi.Float(0.5), mi.Point2f(u[:2]))
    wo = mi.warp.square_to_uniform_hemisphere(mi.Point2f(u[2:]))
    albedo = 2 * np.pi * np.array(bsdf.eval(context, si, wo)).mean(axis=1)
    sampled = np.array(weight).mean(axis=1)
    assert sampled == pytest.approx(albedo, rel=0.05)
    assert (sampled < 1).all()


def test_the_spectral_form_is_refused_in_one_line(tmp_path):
    content = measured.fields()
    content["spectra"] = content.pop("rgb")
    content["wavelengths"] = np.array([400, 550, 700], np.float32)
    (tmp_path / "spectral.bsdf").write_bytes(measured.tensor_file(content))
    with pytest.raises(InputError, match="spectral format") as refused:
        load_material(MaterialConfig(bsdf={"type": "measured", "filename": str(tmp_path / "spectral.bsdf")}))
    assert "\n" not in str(refused.value)
