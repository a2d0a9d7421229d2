"""Near field: flagged where the environment is near for the object's size."""

import pytest

from rsibr.shading.effects.evidence import Evidence, SceneEvidence
from rsibr.shading.effects.near_field import near_field


@pytest.mark.parametrize(("distance", "matters"), [(None, False), (1000.0, False), (5.0, True)])
def test_distance_decides(distance, matters, evidence):
    far = evidence()
    near = SceneEvidence(far.scene, far.of_scene.types, far.of_scene.inputs, distance)
    effect = near_field(Evidence(near, far.camera))
    assert not effect.on
    assert effect.missed == matters
    assert effect.evidence == pytest.approx(0 if distance is None else far.scene.radius / distance)
