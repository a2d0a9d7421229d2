"""Materials that earlier versions got wrong, against the right value: by their parts, by definition, or by Mitsuba."""

import os
import shutil

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.baking.scene import Scene
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.sphere_interaction import interaction
from rsibr.lobes.albedo import mirror_albedo
from rsibr.lobes.split import LobeSplit
from rsibr.methods.reconstruction import reconstruct
from rsibr.planning.material_probe import probe_material
from rsibr.scene.config import MaterialConfig
from rsibr.scene.material import load_material
from rsibr.scene.mitsuba_bsdf import load_bsdf
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.spectra import found_spectra
from tests.faults.cases import case

SMALL = ["map.resolution=12", "sampling.samples=256"]
VIEW = (1, 2, 3)
FRAME = view_frame(np.array(VIEW) / np.linalg.norm(VIEW))

MIRROR = {"type": "conductor", "material": "none"}
COPPERY = MIRROR | {"specular_reflectance": {"type": "rgb", "value": [1.0, 0.7, 0.3]}}
MATTE = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.4, 0.1]}}
PLASTIC = {"type": "plastic", "diffuse_reflectance": {"type": "rgb", "value": [0.6, 0.3, 0.1]}}
GLOSSY = {"type": "roughplastic", "alpha": 0.1, "diffuse_reflectance": {"type": "rgb", "value": [0.6, 0.3, 0.1]}}


def blend(weight, first, second):
    return {"type": "blendbsdf", "weight": weight, "first": first, "second": second}


def bumped(nested):
    return {"type": "bumpmap", "height": {"type": "uniform", "value": 0.5}, "nested": nested}


def mapped(nested, normal=(0.5, 0.5, 1.0)):
    return {"type": "normalmap", "normalmap": {"type": "rawconstant", "value": list(normal)}, "nested": nested}


def sampled(bsdf, cosine, count=2**16):
    """Directional albedo by Mitsuba's own protocol: mean weight of samples, of all and of delta ones; shapes (3,)."""
    rng = np.random.default_rng(3)
    u = (np.arange(count) + rng.random(count)) / count
    si = interaction(mi.Vector3f(np.sqrt(1 - cosine**2) * dr.ones(mi.Float, count), 0, cosine))
    drawn, weight = bsdf.sample(mi.BSDFContext(), si, mi.Float(u), mi.Point2f(rng.random((2, count))))
    is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
    parts = [np.broadcast_to(np.array(part), (3, count)) for part in (weight, dr.select(is_delta, weight, 0))]
    return [part.mean(axis=1, dtype=np.float64) for part in parts]


def sphere_of(case_name, *overrides, bsdf=None, seed=1):
    """Mean radiance over the disk of a map toward `VIEW`, by the integrator of a bake; shape (3,)."""
    config = Scene.prepare(case(case_name), [*SMALL, *overrides]).config
    if bsdf is not None:
        config = config.model_copy(update={"material": MaterialConfig(bsdf=bsdf)})
    integrator = Scene.prepare(config).integrator
    texels = integrator.block(FRAME, 256, np.random.SeedSequence(seed)).sum(axis=1)
    return np.average(texels, axis=0, weights=integrator.coverage[integrator.coverage > 0])


# ---- Tangents and texture coordinates ----


@pytest.mark.slow
def test_bumpmap(tmp_path):
    """A bump map over a constant is the BSDF below it: stored and reconstructed, with its lobes and its plan."""
    plain = sphere_of("bumpmap", bsdf={"type": "roughplastic", "alpha": 0.1})
    baked = bake(Scene.prepare(case("bumpmap"), SMALL), out=tmp_path / "b.rsibr")
    assert [lobe.name.partition("-")[0] for lobe in baked.manifest.lobes] == ["diffuse", "glossy"]
    found = reconstruct(baked, view=VIEW, method="rsibr")
    assert np.average(found.image, axis=(0, 1), weights=found.coverage) == pytest.approx(plain, rel=0.02)
    assert sphere_of("bumpmap") == pytest.approx(plain, rel=0.01)


@pytest.mark.parametrize("wrapped", [bumped, mapped])
def test_a_map_that_tilts_nothing_is_the_bsdf_below_it(wrapped):
    plain, around = load_bsdf(GLOSSY, "here"), load_bsdf(wrapped(GLOSSY), "here")
    alike = zip(LobeSplit.of(plain).lobes, LobeSplit.of(around).lobes, strict=True)
    for one, other in alike:
        assert other.alpha == pytest.approx(one.alpha, rel=1e-3)
        assert other.albedo == pytest.approx(one.albedo, abs=1e-4)


def test_a_tilted_normal_is_flagged_and_a_tilted_mirror_refused():
    bsdf = load_bsdf(mapped(GLOSSY, (0.65, 0.55, 0.95)), "here")
    assert probe_material(bsdf, LobeSplit.of(bsdf)).anisotropy > 0.1
    with pytest.raises(InputError, match="mirror that is tilted against the surface"):
        load_material(MaterialConfig(bsdf=mapped(blend(0.5, MATTE, MIRROR), (0.65, 0.55, 0.95))))
    load_material(MaterialConfig(bsdf=mapped(MIRROR)))


# ---- Delta parts in mixing wrappers ----


def test_blend_mirror_energy(tmp_path):
    """0.7 · 1 + 0.3 · 0.5 at every texel, stored and reconstructed."""
    baked = bake(Scene.prepare(case("blend_mirror_energy"), SMALL), out=tmp_path / "b.rsibr")
    stored, found = baked.map(0), reconstruct(baked, view=VIEW, method="rsibr")
    assert stored.radiance[stored.coverage > 0] == pytest.approx(0.85, rel=0.02)
    assert found.image[found.coverage > 0] == pytest.approx(0.85, rel=0.01)


@pytest.mark.parametrize(
    ("bsdf", "parts"),
    [
        (blend(0.3, COPPERY, MATTE), [(0.7, COPPERY), (0.3, MATTE)]),
        (blend(0.4, PLASTIC, COPPERY), [(0.6, PLASTIC), (0.4, COPPERY)]),
        (blend(0.5, blend(0.2, COPPERY, MATTE), PLASTIC), [(0.4, COPPERY), (0.1, MATTE), (0.5, PLASTIC)]),
        (blend(0.0, COPPERY, MATTE), [(1.0, COPPERY)]),
        (blend(1.0, COPPERY, GLOSSY), [(1.0, GLOSSY)]),
        (bumped(blend(0.3, COPPERY, MATTE)), [(0.7, COPPERY), (0.3, MATTE)]),
        ({"type": "twosided", "nested": blend(0.3, COPPERY, MATTE)}, [(0.7, COPPERY), (0.3, MATTE)]),
    ],
    ids=["mirror", "plastic", "nested", "weight 0", "weight 1", "bump map", "two sides"],
)
def test_a_blend_reflects_the_weighted_sum_of_its_parts(bsdf, parts):
    whole, loaded = load_bsdf(bsdf, "here"), [(weight, load_bsdf(part, "here")) for weight, part in parts]
    for cosine in (0.9, 0.25):
        by_parts = [[weight * value for value in sampled(part, cosine)] for weight, part in loaded]
        for value, expected in zip(sampled(whole, cosine), np.sum(by_parts, axis=0), strict=True):
            assert value == pytest.approx(expected, rel=5e-3, abs=1e-6)
    expected = sum(weight * mirror_albedo(part) for weight, part in loaded)
    assert mirror_albedo(whole) == pytest.approx(expected, rel=1e-5, abs=1e-7)


def test_the_density_of_a_blend_is_that_of_its_samples():
    bsdf, count = load_bsdf(blend(0.4, PLASTIC, blend(0.5, GLOSSY, MIRROR)), "here"), 4096
    rng = np.random.default_rng(1)
    si = interaction(mi.Vector3f(0.6 * dr.ones(mi.Float, count), 0, 0.8))
    drawn, weight = bsdf.sample(mi.BSDFContext(), si, mi.Float(rng.random(count)), mi.Point2f(rng.random((2, count))))
    smooth = ~np.array(mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta))
    value, pdf = (np.array(part) for part in bsdf.eval_pdf(mi.BSDFContext(), si, drawn.wo))
    assert 0.2 < smooth.mean() < 0.8
    assert pdf[smooth] == pytest.approx(np.array(drawn.pdf)[smooth], rel=1e-5)
    assert value[:, smooth] == pytest.approx((np.array(weight) * np.array(drawn.pdf))[:, smooth], rel=1e-4, abs=1e-6)


# ---- Lobes that reflect nothing ----


def test_roughplastic_no_specular_nan():
    found = sphere_of("roughplastic_no_specular_nan")
    almost = GLOSSY | {"specular_reflectance": 1e-8}
    assert found == pytest.approx(sphere_of("roughplastic_no_specular_nan", bsdf=almost), rel=1e-3)
    assert found.min() > 0.01


@pytest.mark.parametrize("kind", ["plastic", "roughplastic", "pplastic"])
def test_a_plastic_that_reflects_nothing_is_black_and_draws_no_nan(kind):
    zero = {"diffuse_reflectance": {"type": "rgb", "value": [0, 0, 0]}, "specular_reflectance": 0.0}
    black = load_bsdf({"type": kind} | zero, "here")
    assert not np.any(sampled(black, 0.5))
    half = sampled(load_bsdf(blend(0.5, {"type": kind} | zero, COPPERY), "here"), 0.5)
    assert half[0] == pytest.approx(0.5 * np.array([1.0, 0.7, 0.3]), rel=1e-3)


def test_a_black_base_beside_a_mirror_gets_no_lobe():
    """An empty matte lobe made every reconstruction of a plastic without diffuse reflection black."""
    assert LobeSplit.of(load_bsdf(PLASTIC | {"diffuse_reflectance": 0.0}, "here")).names == ["mirror"]
    assert LobeSplit.of(load_bsdf(blend(0.0, COPPERY, MATTE), "here")).names == ["mirror"]
    assert LobeSplit.of(load_bsdf({"type": "diffuse", "reflectance": 0.0}, "here")).names == ["diffuse"]


# ---- A texture of one's own, which no name gives away ----

TEXTURE = """
import drjit as dr
import mitsuba as mi


class Stripes(mi.Texture):
    def __init__(self, props):
        super().__init__(props)

    def eval(self, si, active=True):
        return mi.Color3f(0.5 + 0.4 * dr.sin(6 * dr.pi * si.uv.x))

    def mean(self):
        return mi.Float(0.5)

    def to_string(self):
        return "Stripes"


mi.register_texture("stripes", Stripes)
"""


def test_a_texture_in_python_is_flagged_and_refused_on_a_mirror(tmp_path):
    module = tmp_path / "stripes.py"
    module.write_text(TEXTURE)
    load_plugins([str(module)])
    scene = Scene.prepare(
        {
            "environment": {"emitter": {"type": "constant"}},
            "material": {"bsdf": {"type": "diffuse", "reflectance": {"type": "stripes"}}},
            "map": {"resolution": 8},
        }
    )
    assert scene.plan["spatial_variation"].missed
    assert scene.plan.needs_views  # no closed form, though the sky is constant
    with pytest.raises(InputError, match="mirror that differs from place to place"):
        load_material(MaterialConfig(bsdf={"type": "conductor", "specular_reflectance": {"type": "stripes"}}))


# ---- Files that an XML names ----


@pytest.mark.parametrize("file", ["direct.xml", "path.xml"])
def test_xml_relative_spectrum(file, tmp_path, monkeypatch):
    """The spectrum beside the XML is read and digested, from any folder, whatever file of that name lies there."""
    folder = shutil.copytree(case("xml_relative_spectrum").parent / "xml", tmp_path / "xml")
    decoy = tmp_path / "elsewhere" / "sub"
    decoy.mkdir(parents=True)
    for place in (decoy, decoy.parent):
        (place / "refl.spd").write_text("400 0.9\n700 0.9\n")
    monkeypatch.chdir(decoy.parent)
    material = load_material(MaterialConfig(file=folder / file))
    expected = [(400.0, 0.1), (500.0, 0.2), (600.0, 0.7), (700.0, 0.9)]
    ((name, samples),) = found_spectra(folder / file, "here")
    assert name == "diffuse_reflectance"
    assert np.array(samples) == pytest.approx(np.array(expected), rel=1e-6)
    red, _, blue = sampled(material.bsdf(), 0.9)[0]
    assert red > 3 * blue
    (folder / "sub" / "refl.spd").write_text("400 0.2\n700 0.2\n")
    assert load_material(MaterialConfig(file=folder / file)).digest != material.digest
    (folder / "sub" / "refl.spd").unlink()
    with pytest.raises(InputError, match="there is no file"):
        load_material(MaterialConfig(file=folder / file))


SECRET = "hunter2"


@pytest.mark.parametrize(
    ("content", "xml"),
    [
        (f"user:{SECRET}\n", '<spectrum name="reflectance" filename="FILE"/>'),
        (f"400 0.5\n500 {SECRET}\n", '<spectrum name="reflectance" filename="FILE"/>'),
        (f"{SECRET} 1\n", '<spectrum name="reflectance" filename="FILE"/>'),
        (
            f"user:{SECRET}\n",
            '<texture name="reflectance" type="bitmap"><string name="filename" value="FILE"/></texture>',
        ),
        (f"user:{SECRET}\n", '<include filename="FILE"/>'),
        (f"<{SECRET}/>", '<include filename="FILE"/>'),
        (f'<scene version="3.0.0"><{SECRET} name="a"/></scene>', '<include filename="FILE"/>'),
        (f"<a>&{SECRET};</a>", '<include filename="FILE"/>'),
    ],
)
def test_no_error_quotes_a_file_that_an_xml_names(content, xml, tmp_path):
    (tmp_path / "private.txt").write_text(content)
    file = tmp_path / "m.xml"
    xml = xml.replace("FILE", "private.txt")
    file.write_text(f'<scene version="3.0.0"><bsdf type="diffuse">{xml}</bsdf></scene>')
    with pytest.raises(InputError) as caught:
        load_material(MaterialConfig(file=file))
    assert SECRET not in str(caught.value)
    assert caught.value.__cause__ is None
    assert caught.value.__context__ is None or caught.value.__suppress_context__


@pytest.mark.parametrize("text", ["400 x", "400 0.1 0.2\n500 1", "500 0.1\n400 0.2", "400 nan\n500 1", "400 0.5", ""])
def test_a_file_that_is_no_spectrum_is_refused_by_name_and_line(text, tmp_path):
    file = tmp_path / "a.spd"
    file.write_text(text)
    with pytest.raises(InputError, match=r"a\.spd"):
        load_bsdf({"type": "diffuse", "reflectance": {"type": "spectrum", "filename": str(file)}}, "here")


def test_a_pipe_is_never_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    file = tmp_path / "m.xml"
    file.write_text('<bsdf type="diffuse" version="3.0.0"><spectrum name="reflectance" filename="pipe"/></bsdf>')
    with pytest.raises(InputError, match="no regular file"):
        load_material(MaterialConfig(file=file))


def test_an_xml_that_includes_itself(tmp_path):
    file = tmp_path / "m.xml"
    file.write_text('<scene version="3.0.0"><include filename="m.xml"/></scene>')
    with pytest.raises(InputError, match="include"):
        load_material(MaterialConfig(file=file))


LONG = "a" * 5000
"""Longer than any file name of the system."""


@pytest.mark.parametrize(
    "body",
    [
        f'<path value="{LONG}"/><bsdf type="diffuse"/>',
        f'<bsdf type="diffuse"><spectrum name="reflectance" filename="{LONG}"/></bsdf>',
        f'<bsdf type="measured"><string name="filename" value="{LONG}"/></bsdf>',
    ],
)
def test_a_name_in_xml_that_the_system_cannot_hold_is_one_line(tmp_path, body):
    (tmp_path / "m.xml").write_text(f'<scene version="3.0.0">{body}</scene>')
    with pytest.raises(InputError, match="File name too long"):
        load_material(MaterialConfig(file=tmp_path / "m.xml"))


def test_a_name_in_a_plugin_that_the_system_cannot_hold_is_one_line():
    with pytest.raises(InputError, match="there is no file"):
        load_material(MaterialConfig(bsdf={"type": "measured", "filename": f"/{LONG}"}))
