"""Decisions of the plan: closed forms, forced switches, what is flagged."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.lobes.albedo import over_disk
from rsibr.planning.lobes import LOBE_EFFECTS, closed_form_error, lobe_maps
from rsibr.planning.maps import left_out_errors
from rsibr.planning.model import VIEW_COUNTS, attenuation, interpolation_error, relative_power
from rsibr.planning.plan import Effect, unique
from tests.planning.scenes import (
    BRUSHED,
    DIFFUSE,
    METAL,
    MIRROR,
    PLASTIC,
    RED,
    RETRO,
    coloured,
    constant,
    gradient,
    planned,
    sky,
    sun,
)

COATED = {"type": "principled", "base_color": 0.4, "metallic": 0.5, "clearcoat": 1.0, "clearcoat_gloss": 0.9}


@pytest.fixture(scope="module")
def plastic():
    return planned(PLASTIC, coloured())


def on(plan):
    return {effect.name for effect in plan.effects if effect.on}


def test_a_matte_material_needs_no_maps_under_any_sky():
    for light in (constant(), gradient(), coloured(), sun()):
        plan = planned(DIFFUSE, light).plan
        assert "view_dependence" not in on(plan)
        assert [lobe.maps_needed for lobe in plan.lobes] == [False]
        assert plan["view_dependence"].evidence < 1e-9


@pytest.mark.parametrize("plugin", [METAL, PLASTIC, COATED, MIRROR, DIFFUSE])
def test_a_constant_sky_needs_no_maps_whatever_the_material(plugin):
    plan = planned(plugin, constant()).plan
    assert not any(lobe.maps_needed or lobe.views_needed for lobe in plan.lobes)
    assert "constant sky" in plan["view_dependence"].why


def test_an_anisotropic_material_has_no_closed_form_even_under_a_constant_sky():
    assert all(lobe.maps_needed for lobe in planned(BRUSHED, constant()).plan.lobes)


def test_a_perfect_mirror_needs_no_maps_and_no_light_samples():
    plan = planned(MIRROR, sun()).plan
    assert [lobe.maps_needed for lobe in plan.lobes] == [False]
    assert "environment" in plan.lobes[0].why
    assert on(plan) & {*LOBE_EFFECTS, "light_sampling"} == {"mirror"}


def test_a_glossy_lobe_needs_maps_and_a_sharper_sky_more_of_them():
    views = [planned(METAL, light).plan.lobes[0] for light in (gradient(), sun())]
    assert all(lobe.maps_needed for lobe in views)
    assert views[0].views_needed == 12 < views[1].views_needed


def test_lobes_are_named_by_what_they_are(plastic):
    assert on(plastic.plan) & set(LOBE_EFFECTS) == {"diffuse", "clear_coat"}
    assert on(planned(METAL, gradient()).plan) & set(LOBE_EFFECTS) == {"glossy"}
    assert on(planned(COATED, gradient()).plan) & set(LOBE_EFFECTS) == {"diffuse", "glossy", "clear_coat"}
    assert on(planned({"type": "plastic"}, gradient()).plan) & set(LOBE_EFFECTS) == {"diffuse", "mirror"}


def test_the_decision_on_maps_can_be_forced_both_ways(plastic):
    (matte, coat), light = plastic.probes.material.lobes, plastic.probes.light
    even = planned(DIFFUSE, constant()).probes.light
    assert lobe_maps(coat, 0.5, light).maps_needed
    assert not lobe_maps(coat, 0.5, light, "off").maps_needed
    assert not lobe_maps(matte, 0.5, even).maps_needed
    assert lobe_maps(matte, 0.5, even, "on").views_needed == 12
    assert not lobe_maps(coat, 0.0, light).maps_needed  # what no one misses needs none


def test_closed_forms_err_as_their_lobe_does(plastic):
    """A plastic's matte base a little, for its shape; its coat by what it shows of the sky, or by all that it is."""
    (matte, coat), light = plastic.probes.material.lobes, plastic.probes.light
    assert 0 < closed_form_error(matte, 1.0, light) < 1e-2
    assert closed_form_error(coat, 1.0, light) == pytest.approx(light.variance, rel=0.1)
    assert closed_form_error(coat, 1.0, planned(DIFFUSE, sun()).probes.light) == 1


def test_what_leaving_a_lobe_out_makes_is_that_of_its_maps(plastic):
    """Under a constant sky, from the albedos alone: mean over the disk of (E_k/E)², and of one lobe alone 1."""
    probes = planned(PLASTIC, constant()).probes
    whole = sum(lobe.albedo for lobe in probes.split.lobes)
    exact = [
        over_disk(lobe.albedo**2 / (whole**2 + 0.01 * over_disk(whole) ** 2)).mean() for lobe in probes.split.lobes
    ]
    found = left_out_errors(probes.split.lobes, probes.material.lobes, probes.light)
    assert found == pytest.approx(exact, rel=5e-2)
    assert planned(METAL, sun()).left_out == pytest.approx([1.0], abs=0.2)


@pytest.mark.parametrize(
    ("plugin", "light", "is_grey"),
    [
        (DIFFUSE, gradient, True),
        (METAL, sun, True),
        (MIRROR, gradient, True),
        (RED, gradient, False),
        (DIFFUSE, coloured, False),
    ],
)
def test_grey_light_on_a_grey_material_is_one_channel(plugin, light, is_grey):
    plan = planned(plugin, light()).plan
    assert plan.grey == is_grey
    assert plan["colour"].on != is_grey
    assert (plan["colour"].error_if_left_out < 1e-7) == is_grey


def test_a_hint_of_colour_is_colour():
    plan = planned(DIFFUSE, sky(lambda d: np.ones(d.shape[:2])[..., None] * [1.0, 1.0, 1.001])).plan
    assert not plan.grey
    assert plan["colour"].evidence == pytest.approx(1e-3, rel=1e-2)


def test_the_light_is_sampled_under_a_sun_and_where_it_lowers_the_noise():
    assert planned(DIFFUSE, sun()).plan.light_samples
    assert not planned(DIFFUSE, gradient()).plan.light_samples
    assert not planned({**METAL, "alpha": 0.05}, gradient()).plan.light_samples
    assert planned(METAL, gradient()).plan.light_samples
    assert planned(PLASTIC, gradient()).plan.light_samples  # the BSDF's own choice between its lobes is noise


def test_the_policy_names_the_small_sources_and_the_clamp():
    plan = planned(METAL, sun()).plan
    assert "% of the light from the brightest 0.1 %" in plan["light_sampling"].why
    assert "nothing is clamped" in plan["light_sampling"].why
    assert "clamped as asked" in planned(METAL, sun(), clamp=10.0).plan["light_sampling"].why


def test_resolution_is_lowered_only_where_the_config_leaves_it_open():
    """A matte sphere under a gradient: 32² texels hold it."""
    open_, asked, forced = (
        planned(DIFFUSE, gradient(), None).plan,
        planned(DIFFUSE, gradient(), 256).plan,
        planned(DIFFUSE, gradient(), 256, resolution="off").plan,
    )
    assert open_.resolution == forced.resolution < 256
    assert asked.resolution == 256
    assert "the config asks for 256²" in asked["resolution"].why
    assert planned(METAL, sun(), None).plan.resolution == 256
    assert planned(DIFFUSE, gradient(), None, resolution="on").plan.resolution == 256
    assert planned(METAL, sun(), 128, resolution="off").plan.resolution == 64


def test_what_maps_cannot_hold_is_flagged():
    assert planned(BRUSHED, gradient()).plan["anisotropy"].missed
    assert planned(RETRO, gradient()).plan["retroreflection"].missed
    plan = planned(METAL, gradient()).plan
    assert plan.missed == ()
    assert list(plan.notes()) == []


def test_what_is_exact_is_off_without_error(plastic):
    for name in ("polarisation", "self_occlusion", "perspective", "spectral"):
        effect = plastic.plan[name]
        assert not effect.on
        assert not effect.missed
        assert effect.error_if_left_out == 0


@pytest.mark.parametrize("name", ["diffuse", "clear_coat"])
def test_a_lobe_forced_off_is_left_out_and_missed(name):
    plan = planned(PLASTIC, gradient(), **{name: "off"}).plan
    assert plan[name].forced == "off"
    assert [effect.name for effect in plan.missed] == [name]
    assert len(plan.left_out) == len(plan.lobes) == 1
    assert plan[name].error_if_left_out > 0.03
    assert name in next(iter(plan.notes()))


def test_forcing_what_the_evidence_says_anyway_is_no_miss():
    plan = planned(METAL, gradient(), diffuse="off", mirror="off", colour="off").plan
    assert plan.missed == ()
    assert plan["diffuse"].forced == "off"


def test_forcing_on_what_is_not_called_for_is_done_and_said():
    plan = planned(METAL, gradient(), colour="on", light_sampling="on").plan
    assert not plan.grey
    assert plan.light_samples
    assert plan["colour"].why.startswith("turned on, though it hardly matters here: ")


def test_nothing_left_is_refused():
    with pytest.raises(InputError, match="nothing is left to bake"):
        planned(DIFFUSE, gradient(), diffuse="off")


def test_a_light_without_extent_cannot_be_met_by_the_bsdf():
    from rsibr.scene.environment import Environment

    beam = Environment("beam", "", None, 0, 0.0, {"type": "directional", "direction": [0, -1, 0]})
    assert planned(DIFFUSE, beam).plan.light_samples
    assert not planned(DIFFUSE, beam).plan.lobes[0].maps_needed
    assert planned(METAL | {"alpha": 0.3}, beam).plan.lobes[-1].views_needed > 12
    with pytest.raises(InputError, match="light_sampling"):
        planned(DIFFUSE, beam, light_sampling="off")


def test_a_black_sky_calls_for_nothing():
    plan = planned(PLASTIC, sky(lambda d: np.zeros(d.shape[:2]))).plan
    assert not any(lobe.maps_needed for lobe in plan.lobes)
    assert "no light" in plan["view_dependence"].why


def test_the_same_scene_gets_the_same_plan():
    """But for the clock: a bake that is resumed must decide alike."""
    one, two = (replace(planned(METAL, gradient()).plan, probe_seconds=0.0) for _ in range(2))
    assert one == two


def test_the_attenuation_of_lambert_is_the_closed_form(plastic):
    """Ramamoorthi & Hanrahan (2001): Â over π is 1, 2/3, 1/4, 0, −1/24, 0, 1/64."""
    matte = plastic.probes.material.lobes[0]
    assert attenuation(matte, 6) == pytest.approx([1, 2 / 3, 1 / 4, 0, -1 / 24, 0, 1 / 64])


def test_the_power_that_a_lobe_shows_of_a_gradient_has_a_closed_form(plastic):
    """Band 1 alone: Lambert's lobe shows (2/3)² of a²/3."""
    light = planned(DIFFUSE, gradient(0.6)).probes.light
    assert relative_power(plastic.probes.material.lobes[0], light) == pytest.approx(1 + (2 / 3) ** 2 * 0.12, rel=1e-3)


def test_more_views_err_less(plastic):
    coat, light = plastic.probes.material.lobes[1], planned(DIFFUSE, sun()).probes.light
    errors = [interpolation_error(coat, 0.5, light, count) for count in VIEW_COUNTS]
    assert all(a >= b > 0 for a, b in pairwise(errors))
    assert errors[-1] < 1e-3 < errors[0] <= 0.5


def test_two_effects_of_one_name_are_a_bug():
    effect = Effect("a", True, None, 1.0, 0.0, "", "")
    with pytest.raises(ValueError, match="share a name"):
        unique([effect, effect])
