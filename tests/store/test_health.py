"""Texels that cannot be trusted are found where they are; a sound map has none; the manifest says so."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.baking.blocks import Blocks
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.view import bake_view
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.scene.config import parse_config
from rsibr.store.bake import BakeWriter, open_bake
from rsibr.store.health import LARGEST_HALF, map_health
from rsibr.store.manifest import HealthRecord, read_manifest
from rsibr.store.map_file import MapFile
from tests.store import synthetic

N = 64
KINDS = ("non_finite", "holes", "fireflies", "half_overflow")
SKY = {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}


def noisy_map(rng: np.random.Generator, blocks: int = 16, noise: float = 0.05) -> MapFile:
    """Radiance 1 to 3 across the map, each block of samples with a relative Gaussian noise of its own."""
    truth = np.linspace(1, 3, N)[:, None, None] * np.ones((N, N, 3))
    samples = truth * (1 + noise * np.sqrt(blocks) * rng.standard_normal((blocks, N, N, 1)))
    frame = view_frame([0.2, 0.5, 0.8])
    image, variance = samples.mean(axis=0).astype(np.float32), (samples.var(axis=0, ddof=1) / blocks).astype(np.float32)
    return MapFile(frame[:, 2].copy(), frame, {"radiance": image}, variance, texel_coverage(N).astype(np.float32))


def changed(map_file: MapFile, part: str, where: tuple, value: object) -> MapFile:
    """Return a copy with one value put in."""
    images = {"variance": map_file.variance, "coverage": map_file.coverage, **map_file.layers}
    image = images[part].copy()
    image[where] = value
    if part in map_file.layers:
        return replace(map_file, layers={**map_file.layers, part: image})
    return replace(map_file, **{part: image})


def places(map_file: MapFile) -> dict[str, list[tuple[int, int]]]:
    found = map_health(map_file).found
    return {kind: [tuple(cell) for cell in np.argwhere(found[kind]).tolist()] for kind in KINDS if found[kind].any()}


def test_a_sound_map_has_nothing(rng):
    """Chance that Gaussian noise shows a firefly: below 1e-36 for the whole map, see `firefly_texels`."""
    assert places(noisy_map(rng)) == {}
    record = map_health(noisy_map(rng)).record()
    assert record == HealthRecord(non_finite=0, holes=0, fireflies=0, half_overflow=0, largest=record.largest)
    assert 3 < record.largest < 3.8


def test_false_alarms_of_the_fewest_samples_are_as_rare_as_stated(rng):
    """Two blocks: at most 1e-5 a texel is stated, 1.3 expected of 40 maps; more than 7 have a chance of 7e-5."""
    maps = [noisy_map(np.random.default_rng(seed), blocks=2, noise=0.2) for seed in range(40)]
    assert sum(map_health(m).record().fireflies for m in maps) <= 7


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", ["radiance", "variance"])
def test_what_is_no_number_is_found_at_its_place(rng, part, value):
    sick = changed(noisy_map(rng), part, (20, 31, 1), value)
    assert places(sick) == {"non_finite": [(20, 31)]}
    assert np.isfinite(map_health(sick).largest)


def test_opposite_infinities_of_two_lobes_are_found_and_not_added_up(rng):
    sound = noisy_map(rng)
    lobes = {"a": sound.layers["radiance"].copy(), "b": sound.layers["radiance"].copy()}
    lobes["a"][5, 30], lobes["b"][5, 30] = np.inf, -np.inf
    assert places(replace(sound, layers=lobes)) == {"non_finite": [(5, 30)]}


def test_what_lies_outside_the_disk_is_nobodys_business(rng):
    sick = noisy_map(rng)
    outside = sick.coverage == 0
    for value in (np.nan, 1e30):
        sick = changed(sick, "radiance", np.nonzero(outside), value)
    assert places(sick) == {}
    assert map_health(sick).largest < 4


@pytest.mark.parametrize("value", [0.0, 0.4, np.nan])
def test_a_hole_is_found_at_its_place(rng, value):
    assert places(changed(noisy_map(rng), "coverage", (40, 12), value)) == {"holes": [(40, 12)]}


def firefly(map_file: MapFile, row: int, column: int, blocks: int = 16, factor: float = 400.0) -> MapFile:
    """One block of one texel is `factor` times as bright: what a single lucky sample does."""
    mean = map_file.layers["radiance"][row, column]
    spike = mean * factor
    variance = map_file.variance[row, column] + (spike / blocks) ** 2
    hot = changed(map_file, "radiance", (row, column), mean + spike / blocks)
    return changed(hot, "variance", (row, column), variance)


def test_a_firefly_is_found_at_its_place_and_the_rim_too(rng):
    for row, column in ((32, 32), (63, 32), (10, 20)):
        assert places(firefly(noisy_map(rng), row, column)) == {"fireflies": [(row, column)]}


def test_twelve_fireflies_side_by_side_are_all_found(rng):
    sick = noisy_map(rng)
    cells = [(30 + i // 4, 30 + i % 4) for i in range(12)]
    for row, column in cells:
        sick = firefly(sick, row, column)
    assert places(sick) == {"fireflies": cells}


def test_a_highlight_that_is_certain_is_no_firefly(rng):
    bright = changed(noisy_map(rng), "radiance", (32, 32), 500.0)
    assert places(bright) == {}


def test_noise_that_is_as_strong_all_around_is_no_firefly(rng):
    assert places(noisy_map(rng, noise=0.5)) == {}


def test_without_a_variance_nothing_is_called_a_firefly(rng):
    hot = firefly(noisy_map(rng), 32, 32)
    assert places(replace(hot, variance=None)) == {}


def test_what_half_precision_cannot_hold_is_found(rng):
    just = changed(noisy_map(rng), "radiance", (32, 32, 0), LARGEST_HALF)
    assert np.isfinite(np.float16(LARGEST_HALF))
    assert places(just) == {}
    over = changed(just, "radiance", (33, 32, 2), 1e5)
    assert places(over) == {"half_overflow": [(33, 32)]}
    assert map_health(over).record().largest == 1e5


def test_the_relative_error_is_that_of_the_noise(rng):
    """The mean of 3000 estimates with 15 degrees of freedom: ± 0.4 % at one standard deviation."""
    error = map_health(noisy_map(rng, noise=0.1)).relative_error
    assert np.isnan(error[0, 0])
    assert np.nanmean(error) == pytest.approx(0.1, rel=0.05)


def test_the_manifest_keeps_the_counts_of_each_view(tmp_path):
    count = synthetic.COUNT
    sick = synthetic.baked(count, 1)
    sick.layers["radiance"][3, 4] = np.nan
    with BakeWriter.open(tmp_path, synthetic.manifest(count)) as writer:
        for index, map_file in ((1, sick), *((i, synthetic.baked(count, i)) for i in (0, 2, 3))):
            writer.commit(index, map_file, 0.25)
    views = read_manifest(tmp_path / "manifest.json").views
    assert [view.health.non_finite for view in views] == [0, 1, 0, 0]
    assert np.isnan(open_bake(tmp_path).map(1).layers["radiance"][3, 4]).all()  # stored as it was


def test_a_bake_from_before_this_record_is_read(tmp_path):
    manifest = synthetic.manifest()
    old = manifest.views[0].finished("ab" * 32, 0.5, 100)
    assert old.health is None
    assert old.model_validate_json(old.model_dump_json(exclude={"health"})) == old


def glossy_nan() -> mi.BSDF:
    """A lobe whose density is NaN at grazing angles, as 0/0 gives."""

    class Sick(mi.BSDF):
        def __init__(self, properties):
            super().__init__(properties)
            self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
            self.m_flags = self.m_components[0]

        def sample(self, context, si, sample1, sample2, active=True):
            drawn = dr.zeros(mi.BSDFSample3f, dr.width(si))
            drawn.wo = mi.reflect(si.wi)
            drawn.pdf = dr.select(si.wi.z < 0.3, dr.nan, mi.Float(1))
            drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            return drawn, mi.Color3f(1)

        def eval_pdf(self, context, si, wo, active=True):
            return mi.Color3f(0), mi.Float(0)

    mi.register_bsdf("nan-glossy", Sick)
    return mi.load_dict({"type": "nan-glossy"})


@pytest.mark.parametrize("clamp", [None, 0.5])
def test_nan_samples_of_a_glossy_lobe_are_counted_clamped_or_not(clamp):
    integrator = SphereIntegrator(SKY, glossy_nan(), 16, clamp=clamp)
    baked = bake_view(integrator, np.eye(3), Blocks(4, 2), seed=0, index=0)
    x, y = np.meshgrid(*[(np.arange(16) + 0.5) / 8 - 1] * 2)
    sick = map_health(baked).found["non_finite"]
    grazing = np.hypot(x, y)
    assert sick[(grazing > 0.97) & (baked.coverage > 0)].all()  # n·v < 0.3 from 0.954 on
    assert not sick[grazing < 0.85].any()


def config(tmp_path, **sampling):
    data = {
        "environment": {"emitter": {"type": "constant", "radiance": 2.0}},
        "material": {"bsdf": {"type": "conductor", "material": "none"}},
        "map": {"resolution": 8},
        "sampling": {"samples": 16, **sampling},
    }
    return parse_config(data, tmp_path)


def test_clamp_is_of_each_sample_and_recorded(tmp_path):
    clamped = bake(config(tmp_path, clamp=0.75), out=tmp_path / "clamped.rsibr")
    plain = bake(config(tmp_path), out=tmp_path / "plain.rsibr")
    for made, value in ((clamped, 0.75), (plain, 2.0)):
        got = made.map(0)
        assert np.allclose(got.layers["radiance"][got.coverage > 0], value, rtol=1e-5)
    assert clamped.config["sampling"]["clamp"] == 0.75
    assert clamped.manifest.identity["config"]["sampling"]["clamp"] == 0.75
    assert "clamp" not in plain.config["sampling"]


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf"), "much"])
def test_a_clamp_that_is_none_is_refused(tmp_path, value):
    with pytest.raises(InputError, match=r"sampling\.clamp"):
        config(tmp_path, clamp=value)
