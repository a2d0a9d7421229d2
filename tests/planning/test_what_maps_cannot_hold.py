"""What a sphere map cannot hold: transmission and textures are refused, anisotropy and retroreflection flagged."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.scene.config import MaterialConfig
from rsibr.scene.material import load_material
from tests.measured_file import load
from tests.planning.scenes import BRUSHED, DIFFUSE, METAL, PLASTIC, RETRO, gradient, planned

GLASS = {"type": "dielectric"}
BOARD = {"type": "checkerboard"}


def refusal(bsdf) -> str:
    with pytest.raises(InputError) as refused:
        load_material(MaterialConfig(bsdf=bsdf))
    return str(refused.value)


@pytest.mark.parametrize(
    "bsdf",
    [
        GLASS,
        {"type": "thindielectric"},
        {"type": "roughdielectric", "alpha": 0.1},
        {"type": "principled", "spec_trans": 0.5},
        {"type": "principledthin", "diff_trans": 0.5},
        {"type": "null"},
        {"type": "mask", "opacity": 0.5, "nested": DIFFUSE},
        {"type": "blendbsdf", "weight": 0.5, "a": DIFFUSE, "b": GLASS},
    ],
    ids=lambda bsdf: bsdf["type"],
)
def test_transmission_is_refused(bsdf):
    assert "lets light through" in refusal(bsdf)


@pytest.mark.parametrize(
    "bsdf",
    [
        {"type": "diffuse", "reflectance": BOARD},
        {"type": "roughconductor", "material": "none", "alpha": BOARD},
        {"type": "blendbsdf", "weight": BOARD, "a": DIFFUSE, "b": METAL},
        {"type": "bumpmap", "arbitrary": BOARD, "bsdf": METAL},
        {"type": "normalmap", "normalmap": BOARD, "bsdf": METAL},
    ],
    ids=lambda bsdf: bsdf["type"],
)
def test_textures_are_refused(bsdf):
    assert "'checkerboard' varies over the surface" in refusal(bsdf)


def test_a_bitmap_is_refused_without_being_read(tmp_path):
    picture = tmp_path / "none.png"
    picture.write_bytes(b"no picture")
    texture = {"type": "bitmap", "filename": str(picture)}
    assert "'bitmap' varies over the surface" in refusal({"type": "diffuse", "reflectance": texture})


@pytest.mark.parametrize(
    "bsdf",
    [
        BRUSHED,
        {"type": "principled", "metallic": 1.0, "roughness": 0.3, "anisotropic": 0.8},
        PLASTIC,
    ],
    ids=lambda bsdf: bsdf["type"],
)
def test_anisotropy_is_flagged(bsdf):
    """In the notes of the material, which bakes and reports show, and in the plan; an isotropic plastic in neither."""
    brushed = bsdf is not PLASTIC
    assert any("anisotropic" in note for note in load_material(MaterialConfig(bsdf=bsdf)).notes) is brushed
    assert planned(bsdf, gradient()).plan["anisotropy"].missed is brushed


def test_a_measured_anisotropy_is_flagged_by_its_values(tmp_path):
    """Mitsuba's flags say of no measured file that it is anisotropic, and those with more than two azimuths are."""
    measured = load()
    turned = measured.fields() | {"phi_i": np.linspace(-np.pi, np.pi, 4, dtype=np.float32)}
    for name in ("vndf", "luminance", "rgb"):  # the same at each azimuth of the view, in a frame that does not turn
        turned[name] = np.repeat(turned[name], 4, axis=0)
    (tmp_path / "turned.bsdf").write_bytes(measured.tensor_file(turned))
    found = []
    for file in (measured.FILE, tmp_path / "turned.bsdf"):
        bsdf = {"type": "measured", "filename": str(file)}
        assert load_material(MaterialConfig(bsdf=bsdf)).notes == ()
        found.append(planned(bsdf, gradient()).plan["anisotropy"].missed)
    assert found == [False, True]


@pytest.mark.parametrize(("bsdf", "flagged"), [(RETRO, True), (RETRO | {"retro_share": 0.02}, False)])
def test_retroreflection_beyond_the_threshold_is_flagged(bsdf, flagged):
    effect = planned(bsdf, gradient()).plan["retroreflection"]
    assert effect.missed is flagged
    assert (effect.evidence > effect.threshold) is flagged


@pytest.mark.parametrize(("bsdf", "unfitted"), [(BRUSHED, True), (RETRO, True), (PLASTIC, False), (METAL, False)])
def test_lobes_that_the_model_does_not_represent_are_flagged_with_what_to_do(bsdf, unfitted):
    plan = planned(bsdf, gradient()).plan
    effect = plan["unfitted"]
    assert effect.missed is unfitted
    assert not effect.on
    assert all(words in effect.why for words in ("more views", "cabral1999", "rsibr-fine")) is unfitted
    assert any("fitted lobes err by" in note for note in plan.notes()) is unfitted


def test_a_plan_records_the_fit_of_each_lobe_by_angle():
    """Each lobe errs at least at one angle by what all together do at the worst; a mirror has no fit."""
    found = planned({"type": "plastic"}, gradient())
    matte, mirror = found.plan.lobes
    assert (mirror.fit_angles, mirror.fit_errors) == ((), ())
    assert len(matte.fit_angles) == len(matte.fit_errors) == 6
    assert list(matte.fit_angles) == sorted(matte.fit_angles)
    assert all(0 <= error <= 1 for error in matte.fit_errors)
    assert found.plan["unfitted"].evidence <= max(matte.fit_errors) + 1e-4
