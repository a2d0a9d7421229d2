"""What is measured of the material, against what it was made of."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.lobes.albedo import node_cosines, over_disk
from rsibr.lobes.bsdf_eval import RETRO_RATIO
from rsibr.lobes.split import LobeSplit
from rsibr.planning.material_probe import probe_material
from rsibr.scene.config import MaterialConfig
from rsibr.scene.material import load_material
from rsibr.scene.presets import PRESETS
from tests.planning.scenes import BRUSHED, DIFFUSE, METAL, MIRROR, PLASTIC, RED, RETRO


def probe(plugin):
    bsdf = mi.load_dict(plugin)
    return probe_material(bsdf, LobeSplit.of(bsdf))


def test_lambert_has_lamberts_shape_and_nothing_else():
    found = probe(DIFFUSE)
    (lobe,) = found.lobes
    assert lobe.kind == "diffuse"
    assert lobe.share == 1
    assert lobe.shape_error < 1e-6
    assert lobe.albedo == pytest.approx([0.5] * 3, rel=1e-3)
    assert max(found.chroma, found.anisotropy, found.variation) < 1e-6
    assert found.fresnel < 1e-6


def test_a_red_material_is_coloured_by_its_closed_form():
    """Relative to the largest channel: (0.8 − 0.1)/0.8."""
    assert probe(RED).chroma == pytest.approx(0.7 / 0.8, rel=1e-3)


@pytest.mark.parametrize("plugin", [DIFFUSE, METAL, PLASTIC, MIRROR])
def test_grey_materials_are_grey(plugin):
    assert probe(plugin).chroma < 1e-5


def test_a_coloured_mirror_is_coloured_though_it_has_no_smooth_part():
    assert probe({"type": "conductor", "material": "Cu"}).chroma > 0.1


def test_a_mirror_is_one_lobe_without_shape():
    (lobe,) = probe(MIRROR).lobes
    assert (lobe.kind, lobe.share) == ("mirror", 1)


@pytest.mark.parametrize(
    "plugin",
    [
        BRUSHED,
        BRUSHED | {"alpha_u": BRUSHED["alpha_v"], "alpha_v": BRUSHED["alpha_u"]},  # turned by a right angle
        {"type": "principled", "metallic": 1.0, "roughness": 0.3, "anisotropic": 0.8},
    ],
)
def test_an_anisotropic_material_changes_when_both_directions_turn(plugin):
    assert probe(plugin).anisotropy > 0.3


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_isotropic_the_same_all_over_and_sends_nothing_back(name):
    bsdf = load_material(MaterialConfig(preset=name)).bsdf()
    found = probe_material(bsdf, LobeSplit.of(bsdf))
    assert found.anisotropy < 1e-4
    assert found.variation == 0
    assert found.retro_ratio <= RETRO_RATIO
    assert sum(lobe.share for lobe in found.lobes) == pytest.approx(1)


def test_a_retroreflective_blend_is_found_by_its_ratio():
    assert probe(RETRO).retro_ratio > 2 * RETRO_RATIO


def test_a_texture_is_found_by_its_variation():
    board = {"type": "checkerboard", "color0": 0.2, "color1": 0.8, "to_uv": mi.ScalarTransform4f().scale(8)}
    assert probe({"type": "diffuse", "reflectance": board}).variation > 0.1


def test_means_over_the_disk_weigh_by_area():
    """∫ 2 c dc = 1; ∫ 2 c · c dc = 2/3."""
    cosines = node_cosines()
    assert over_disk(np.ones_like(cosines)) == pytest.approx(1)
    assert over_disk(cosines) == pytest.approx(2 / 3, abs=2e-3)


def test_a_plastics_albedo_varies_over_the_angle_and_a_metals_hardly():
    assert probe(PLASTIC).fresnel > 5e-3
    assert probe(METAL).fresnel < 2e-3
