"""Forecast of an object's validation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera
from rsibr.validation.objects.job import METHOD_SECONDS, SHADOW_SECONDS, object_job


def bake(seconds=10.0):
    manifest = SimpleNamespace(lobes=["a", "b"], sampling=SimpleNamespace(samples=256), seconds=seconds)
    return SimpleNamespace(path="one", view_count=12, resolution=160, manifest=manifest)


def primary(side=256, covered=0.5):
    camera = Camera.look_at((0, 0, 4), (0, 0, 0), width=side, height=side)
    return SimpleNamespace(camera=camera, pixels=np.arange(int(covered * side * side)), rays=16)


def test_time_is_that_of_the_samples_at_the_rate_of_the_bake():
    small, double = (object_job(primary(), {"*": bake()}, 1, samples, 8) for samples in (1024, 2048))
    rate = 12 * 256 * 0.785 * 160**2 / 10
    assert double.seconds - small.seconds == pytest.approx(15 * 0.5 * 256**2 * 1024 / rate, rel=1e-3)
    assert object_job(primary(), {"*": bake(seconds=0.0)}, 1, 1024, 8).seconds is None


def test_memory_grows_with_the_picture_and_a_job_beyond_it_is_refused():
    one, two = (object_job(primary(side), {"*": bake()}, 1, 1024, 8) for side in (256, 512))
    assert two.memory - one.memory == pytest.approx(3 * 256**2 * (12 * 8 * 5 + 900), rel=0.01)
    with pytest.raises(InputError, match="of memory"):
        object_job(primary(2**20, 1e-6), {"*": bake()}, 1, 1024, 8).admit(None, False)


def test_a_bake_that_serves_two_shapes_is_held_once():
    one, both = (object_job(primary(), bakes, 1, 64, 8) for bakes in ({"*": bake()}, {"a": bake(), "*": bake()}))
    assert both.memory == one.memory


def test_every_method_takes_its_time_and_more_with_shadows():
    one, nine, shaded = (
        object_job(primary(), {"*": bake()}, methods, 1024, 8, has_shadows=shadows).seconds
        for methods, shadows in ((1, False), (9, False), (9, True))
    )
    flips = 2e-6 * 256**2 * 2 * 8 * 9
    assert nine - one == pytest.approx(8 * METHOD_SECONDS + flips)
    assert shaded - nine == pytest.approx(9 * SHADOW_SECONDS)
