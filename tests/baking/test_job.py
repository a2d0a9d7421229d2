"""Forecast of a bake's size against the bake itself."""

from __future__ import annotations

import numpy as np
import pytest

from rsibr.baking import calibration
from rsibr.baking import job as module
from rsibr.baking.baker import bake
from rsibr.baking.scene import Scene
from rsibr.scene.config import config_of
from rsibr.store.manifest import SamplingRecord

CONFIG = {
    "environment": {"emitter": {"type": "constant", "radiance": 0.5}},
    "material": {"bsdf": {"type": "roughplastic", "alpha": 0.2}},
    "map": {"resolution": 128},
    "sampling": {"samples": 16},
    "effects": {"view_dependence": "on", "resolution": "on", "colour": "on"},
}


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    scene = Scene.prepare(config_of(CONFIG))
    return scene, bake(scene, out=tmp_path_factory.mktemp("job") / "x.rsibr")


def maps_bytes(baked):
    return sum(state.bytes for state in baked.manifest.views)


def test_bytes_of_a_bake_are_forecast_within_a_tenth(baked, monkeypatch, tmp_path):
    """From a trial map that is smaller than those of the bake."""
    scene, made = baked
    monkeypatch.setattr(module, "LARGE_BYTES", 1)
    monkeypatch.setattr(calibration, "TRIAL_SIDE", 96)
    forecast = module.disk_and_memory(scene, tmp_path / "new.rsibr").disk - module.LIGHT_BYTES
    assert forecast == pytest.approx(maps_bytes(made), rel=0.1)


def test_bytes_of_a_small_bake_are_bounded_without_a_trial(baked, monkeypatch, tmp_path):
    scene, made = baked
    monkeypatch.setattr(module, "map_bytes", None)
    forecast = module.disk_and_memory(scene, tmp_path / "new.rsibr").disk - module.LIGHT_BYTES
    assert maps_bytes(made) < forecast < maps_bytes(made) / 0.25


def test_views_on_the_disk_are_not_counted_again(baked):
    scene, made = baked
    everything = module.disk_and_memory(scene, made.path.parent / "absent.rsibr").disk
    assert module.disk_and_memory(scene, made.path).disk == everything - maps_bytes(made)


def test_memory_grows_with_texels_lobes_and_blocks_and_launches_are_bounded(baked):
    integrator = baked[0].integrator
    lobes, texels = len(integrator.lobe_names), int(np.count_nonzero(integrator.coverage))
    few, many = module.bake_memory(integrator, 16), module.bake_memory(integrator, 2**20)
    assert few > 2 * 16 * texels * 12 * lobes
    assert many < 2 * integrator.max_lanes * (12 * lobes + 16) + 2**25
    large = integrator.at_resolution(1024)
    assert module.bake_memory(large, 16) > few + 2 * large.coverage.size * 4 * (3 * lobes + 4)


def test_time_is_in_proportion_to_views_and_unmeasured_for_a_short_bake(baked, monkeypatch):
    scene, _ = baked
    job = module.JobSize("bake")
    sampling = SamplingRecord(block=8, even=2)
    assert module.with_time(job, scene, sampling, 12).seconds is None
    monkeypatch.setattr(module, "TIMED_SAMPLES", 1)
    monkeypatch.setattr(module, "sample_seconds", lambda _integrator, size: {8: 1e-6}[size])
    monkeypatch.setattr(module, "map_overhead", lambda _: 0.5)
    texels = np.count_nonzero(scene.integrator.coverage)
    assert module.with_time(job, scene, sampling, 3).seconds == pytest.approx(3 * (16e-6 * texels + 0.5))
