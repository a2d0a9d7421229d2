"""The material: presets, BSDF dicts, XML files, and everything that is refused before or by Mitsuba."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.resources import scenes
from rsibr.scene.config import MaterialConfig
from rsibr.scene.material import load_material
from rsibr.scene.presets import PRESETS

LAMBERT = '<bsdf version="3.0.0" type="diffuse"><rgb name="reflectance" value="0.2, 0.4, 0.6"/></bsdf>'


def refusal(**keys):
    with pytest.raises(InputError) as caught:
        load_material(MaterialConfig(**keys))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def write(folder, text, name="m.xml"):
    path = folder / name
    path.write_text(text)
    return path


def value(material, cos_in=0.8):
    """f·cos, for light at arccos(cos_in) and the viewer at the normal."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    wo = mi.Vector3f((1 - cos_in**2) ** 0.5, 0, cos_in)
    return np.array(material.bsdf().eval(mi.BSDFContext(), si, wo)).ravel()


def test_presets_are_the_files():
    assert sorted(PRESETS) == sorted(path.stem for path in (scenes() / "materials").glob("*.xml"))


@pytest.mark.parametrize("name", PRESETS)
def test_presets_load_and_reflect_at_most_all(name):
    """Directional albedo by BSDF sampling at three angles; the standard error is below 1 %, the bound is 5 σ wide."""
    material = load_material(MaterialConfig(preset=name))
    assert material.name == name
    assert material.warp == ("normal" if name == "matte-lambert" else "mirror")
    n = 1 << 14
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, n)
    for cosine in (1.0, 0.5, 0.1):
        si = dr.zeros(mi.SurfaceInteraction3f, n)
        si.wi = mi.Vector3f((1 - cosine**2) ** 0.5, 0, cosine)
        _, weight = material.bsdf().sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
        albedo = np.array(weight).mean(axis=1)
        assert (albedo > 0.0).all()
        assert (albedo < 1.05).all()


def test_matte_lambert_is_half_over_pi():
    np.testing.assert_allclose(
        value(load_material(MaterialConfig(preset="matte-lambert"))), 0.5 / np.pi * 0.8, rtol=1e-5
    )


@pytest.mark.parametrize(
    "source",
    [
        LAMBERT,
        f'<scene version="3.0.0">{LAMBERT.replace(" version=", " id=")}</scene>',
        '<scene version="3.0.0"><default name="g" value="0.4"/><bsdf type="diffuse" id="b">'
        '<rgb name="reflectance" value="0.2, $g, 0.6"/></bsdf>'
        '<shape type="obj"><string name="filename" value="not_there.obj"/><ref id="b"/></shape></scene>',
        '<scene version="3.0.0"><include filename="part.xml"/></scene>',
    ],
    ids=["root", "scene", "shape that cannot be loaded", "include"],
)
def test_xml_of_one_bsdf_is_the_same_as_the_dict(tmp_path, source):
    write(tmp_path, f'<scene version="3.0.0">{LAMBERT.replace(" version=", " id=")}</scene>', "part.xml")
    from_xml = load_material(MaterialConfig(file=write(tmp_path, source)))
    reflectance = {"type": "rgb", "value": [0.2, 0.4, 0.6]}
    from_dict = load_material(MaterialConfig(bsdf={"type": "diffuse", "reflectance": reflectance}))
    assert (from_xml.name, from_dict.name) == ("m", "diffuse")
    np.testing.assert_allclose(value(from_xml), np.array([0.2, 0.4, 0.6]) / np.pi * 0.8, rtol=1e-5)
    np.testing.assert_array_equal(value(from_xml), value(from_dict))


def test_xml_finds_files_beside_it(tmp_path):
    write(tmp_path, "400 0.3\n700 0.3\n", "s.spd")
    path = write(
        tmp_path, '<bsdf version="3.0.0" type="diffuse"><spectrum name="reflectance" filename="s.spd"/></bsdf>'
    )
    material = load_material(MaterialConfig(file=path))
    before = str(mi.file_resolver())
    np.testing.assert_allclose(value(material), 0.3 / np.pi * 0.8, rtol=0.02)
    assert str(mi.file_resolver()) == before
    write(tmp_path, "400 0.5\n700 0.5\n", "s.spd")
    assert load_material(MaterialConfig(file=path)).digest != material.digest


@pytest.mark.parametrize(
    ("bsdf", "warp"),
    [
        ({"type": "diffuse"}, "normal"),
        ({"type": "twosided", "a": {"type": "diffuse"}}, "normal"),
        ({"type": "conductor"}, "mirror"),
        ({"type": "roughplastic"}, "mirror"),
        ({"type": "principled"}, "mirror"),
        ({"type": "blendbsdf", "weight": 0.5, "a": {"type": "diffuse"}, "b": {"type": "roughconductor"}}, "mirror"),
    ],
)
def test_auto_warp_follows_the_lobes(bsdf, warp):
    assert load_material(MaterialConfig(bsdf=bsdf)).warp == warp
    assert load_material(MaterialConfig(bsdf=bsdf, warp="normal")).warp == "normal"


def test_digest_knows_content_only(tmp_path):
    a = load_material(MaterialConfig(file=write(tmp_path, LAMBERT)))
    same = f"<!-- a comment -->\n{LAMBERT.replace('><', '>  <')}"
    assert load_material(MaterialConfig(file=write(tmp_path, same, "other.xml"))).digest == a.digest
    assert load_material(MaterialConfig(file=write(tmp_path, LAMBERT.replace("0.4", "0.5")))).digest != a.digest
    children = [{"type": "diffuse"}, {"type": "conductor"}]
    blends = [
        load_material(MaterialConfig(bsdf={"type": "blendbsdf", "weight": 0.2, "a": x, "b": y})).digest
        for x, y in (children, children[::-1])
    ]
    assert blends[0] != blends[1]  # Mitsuba takes them by position


@pytest.mark.parametrize(
    ("bsdf", "parts"),
    [
        ({"type": "nosuch"}, ['"nosuch"', "not found"]),
        ({"type": "diffuse", "foo": 1}, ['"diffuse"', '"foo"']),
        ({"type": "roughplastic", "alpha": "0.1"}, ['"alpha"', "expected float, got string"]),
        ({"type": "diffuse", "reflectance": [0.1, 0.2, 0.3]}, ["Write a colour as {type = 'rgb'"]),
        ({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.1, 0.2, 1.5]}}, ["[0, 1]"]),
        ({"type": "sphere"}, ["'sphere' is not a BSDF (shape)"]),
        ({"type": "rgb", "value": [1, 1, 1]}, ["'rgb' is not a BSDF"]),
        ({"type": "diffuse", "reflectance": {"type": "checkerboard"}}, ["'checkerboard' varies over the surface"]),
        ({"type": "measured", "filename": "/none.bsdf"}, ["no file /none.bsdf"]),
        ({"type": "dielectric"}, ["'dielectric' lets light through"]),
        ({"type": "null"}, ["'null' lets light through"]),
        ({"type": "principled", "spec_trans": 0.5}, ["lets light through"]),
        ({"type": "blendbsdf"}, ["'blendbsdf' has 0 nested BSDFs, and takes 2"]),
        ({"type": "blendbsdf", "weight": 0.5, "a": {"type": "diffuse"}}, ["has 1 nested BSDFs"]),
        ({"type": "twosided"}, ["'twosided' has 0 nested BSDFs, and takes 1 or 2"]),
        ({"type": "twosided", "a": {"type": "blendbsdf"}}, ["'blendbsdf' has 0 nested BSDFs"]),
    ],
)
def test_a_bsdf_that_cannot_be_used(bsdf, parts):
    text = refusal(bsdf=bsdf)
    assert text.startswith("material.bsdf: ")
    for part in parts:
        assert part in text


@pytest.mark.parametrize(
    ("xml", "part"),
    [
        ('<bsdf version="3.0.0" type="blendbsdf"/>', "'blendbsdf' has 0 nested BSDFs"),
        ('<bsdf version="3.0.0" type="diffuse">', "(line 1, col "),
        ('<bsdf version="3.0.0" type="zork"/>', '(line 1, col 2) "zork"'),
        ('<bsdf type="diffuse"/>', "missing version attribute"),
        (LAMBERT.replace("reflectance", "reflectence"), '"reflectence"'),
        ('<shape version="3.0.0" type="sphere"/>', "'sphere' is not a BSDF (shape)"),
        ('<scene version="3.0.0"/>', "holds 0 BSDFs"),
        ('<scene version="3.0.0"><bsdf type="diffuse"/><bsdf type="plastic"/></scene>', "holds 2 BSDFs"),
        ("", "is not well-formed XML (line 1, col 1)"),
    ],
)
def test_an_xml_file_that_cannot_be_used(tmp_path, xml, part):
    path = write(tmp_path, xml)
    text = refusal(file=path)
    assert text.startswith(f"{path}: ")
    assert text.count(str(path)) == 1
    assert part in text


def test_names_that_lead_nowhere(tmp_path):
    text = refusal(preset="clearcoat-read")
    assert "unknown preset 'clearcoat-read' (did you mean 'clearcoat-red'?)" in text
    assert all(name in text for name in PRESETS)
    assert "there is no such material file" in refusal(file=tmp_path / "none.xml")
    assert "there is no such material file" in refusal(file=tmp_path)
