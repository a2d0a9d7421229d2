"""Silhouettes: rays a pixel."""

import pytest

from rsibr.shading.effects.silhouettes import ONE_RAY_ERROR, silhouettes


def test_one_ray_is_told(evidence):
    effect = silhouettes(evidence(rays=1, silhouette_share=0.05))
    assert not effect.on
    assert effect.missed
    assert effect.error_if_left_out == pytest.approx(0.05 * ONE_RAY_ERROR)


def test_several_rays(evidence):
    assert silhouettes(evidence(rays=16, silhouette_share=0.05)).forced is None
    assert silhouettes(evidence(rays=16, silhouette_share=0.0)).on
    assert silhouettes(evidence(rays=16)).evidence > 0
