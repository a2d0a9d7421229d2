"""The plan of a picture tells every effect, and what is left out with its error."""

import pytest

from rsibr.errors import InputError
from rsibr.shading.effects.object_plan import ObjectPlan
from rsibr.shading.effects.registry import object_effects

NAMES = ["perspective", "self_occlusion", "interreflection", "near_field", "silhouettes", "back_facing"]


def test_every_effect_is_told(evidence):
    plan = ObjectPlan.of(evidence())
    assert [effect.name for effect in plan.effects] == list(object_effects()) == NAMES
    lines = list(plan.lines())
    assert len(lines) == len(NAMES)
    assert str(plan) == "\n".join(lines)
    assert not list(plan.notes())


def test_what_is_left_out_is_told_with_its_error(evidence):
    plan = ObjectPlan.of(evidence(switches={"self_occlusion": "off"}))
    notes = list(plan.notes())
    assert [note.split(":")[0] for note in notes] == ["self_occlusion", "interreflection"]
    assert "estimated error (relMSE) 0." in notes[0]
    with pytest.raises(KeyError):
        plan["glitter"]


@pytest.mark.parametrize(
    ("switches", "says"),
    [
        ({"self_oclusion": "on"}, "(?i)did you mean 'self_occlusion'"),
        ({"self_occlusion": "maybe"}, "auto, on, off"),
        ({"near_field": "on"}, "only measured"),
    ],
)
def test_wrong_switches_are_one_line(switches, says, evidence):
    with pytest.raises(InputError, match=says):
        ObjectPlan.of(evidence(switches=switches))
