"""Back-facing normals: counted in each picture."""

import pytest

from rsibr.shading.effects.back_facing import back_facing
from rsibr.shading.pictures.picture import NormalCounts


def test_counts_are_told(evidence):
    assert back_facing(evidence()).on
    effect = back_facing(evidence(counts=NormalCounts(hits=100, replaced=1, flipped=2, bent=3, back=4)))
    assert effect.evidence == pytest.approx(0.06)
    assert all(text in effect.why for text in ("1 replaced", "2 flipped", "3 bent", "4 rays"))
    assert not effect.missed
