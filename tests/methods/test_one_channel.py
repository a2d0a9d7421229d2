"""`effects.colour` off: methods that filter the light themselves show one channel, the red one, as the maps do."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.geometry.frame import unit_view, view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.methods.unbaked import unbaked

OPTIONS = {
    "miller1984": {"illumination_rows": 24, "specular_rows": 24},
    "kautz2003": {"size": 16},
    "split-sum": {"size": 16},
}
"""Small tables: their channels are compared, not their accuracy."""


@pytest.fixture(scope="module")
def scenes(asymmetric_environment):
    config = {"environment": {"file": str(asymmetric_environment)}, "material": {"preset": "clearcoat-red"}}
    return {colour: unbaked(config, [f"effects.colour={colour}"]) for colour in ("on", "off")}


@pytest.mark.parametrize("method", list(OPTIONS))
def test_the_red_channel_stands_for_all(scenes, method):
    frame = view_frame(unit_view((1, 2, 3)))
    coloured, grey = (
        run(MethodSet(scenes[name]).variant(method, **OPTIONS[method]), frame, 16).image for name in ("on", "off")
    )
    assert np.abs(coloured[..., 0] - coloured[..., 2]).max() > 0.1 * coloured.max()
    np.testing.assert_array_equal(grey[..., 1], grey[..., 0])
    np.testing.assert_array_equal(grey[..., 2], grey[..., 0])
    inside = coloured[..., 0] > 0
    ratio = grey[..., 0][inside].mean() / coloured[..., 0][inside].mean()
    assert ratio == pytest.approx(1, abs=0.1)  # fits of the material weigh its channels, so that widths differ


def test_all_of_the_light_is_in_one_channel(scenes):
    light, lobes = MethodSet(scenes["off"]).inputs.light, MethodSet(scenes["off"]).inputs.lobes
    whole = scenes["off"].light
    np.testing.assert_array_equal(light.picture[..., 2], whole.picture[..., 0])
    for one, other in zip(light.levels, whole.levels, strict=True):
        np.testing.assert_array_equal(one[..., 1], other[..., 0])
    for one, other in zip(light.irradiances, whole.irradiances, strict=True):
        np.testing.assert_array_equal(one.image[..., 1], other.image[..., 0])
        assert light.irradiance(one.weights) is one.image
    for one, other in zip(lobes, scenes["off"].manifest.lobes, strict=True):
        np.testing.assert_array_equal(np.array(one.albedo)[:, 2], np.array(other.albedo)[:, 0])
