"""Hard cases 30 to 33: numbers that hide nothing, and clocks that wait."""

import time
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr import backend
from rsibr.errors import CheckFailed
from rsibr.geometry.frame import view_frame
from rsibr.methods import Cost, reconstruction
from rsibr.validation import reference as reference_module
from rsibr.validation.flip import exposures_for
from rsibr.validation.metrics import compare
from rsibr.validation.reference import Reference, ReferenceRenderer
from tests.methods.scene import method
from tests.validation.doubles import GREY_SKY, MIRROR, disk, noisy_reference, smooth_map

EXPOSURES = exposures_for(1.0)


def exact(truth):
    return Reference(np.stack([truth] * 8), disk(len(truth)), samples=64, seconds=1.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("side", ["candidate", "reference"])
@pytest.mark.parametrize("coverage", [1.0, 0.2])
def test_hc30_nan_and_inf_raise_with_their_place(value, side, coverage):
    """A single value in a channel of a texel, judged or only touched: CheckFailed that says where.

    Fails when a map is not looked at before it is averaged: mutant hc30.
    """
    covered = disk()
    covered[7, 9] = coverage
    candidate, reference = smooth_map(), Reference(np.stack([smooth_map()] * 8), covered, samples=64, seconds=1.0)
    (candidate if side == "candidate" else reference.buffers[5])[7, 9, 1] = value
    where = "cabral1999" if side == "candidate" else "reference, buffer 5"
    with pytest.raises(CheckFailed, match=f"{where}, row 7, column 9, channel G"):
        compare(candidate, reference, EXPOSURES, "cabral1999")


def test_hc31_identical_images_have_no_error():
    """Exactly 0, with an interval of no width, and not said to be noise.

    Fails when an exact zero is called noise: mutant hc31.
    """
    error = compare(smooth_map(), exact(smooth_map()), EXPOSURES)
    assert error.rel_mse.value == error.smape == error.flip == error.worst_texel.error == 0
    assert error.rel_mse.ci95 == (0, 0)
    assert not error.rel_mse.below_noise_floor


def test_hc31_a_difference_of_noise_alone_has_an_interval_that_covers_zero(rng, monkeypatch):
    """Relative standard errors of 0.3 to 3 %: of 100 intervals of 95 % fewer than 84 cover 0 with probability 1e-5.

    The noise's bias is taken out twice, texel by texel and by the jackknife, and either would do: so the guards are the
    intervals. Fails when they are those of a plain mean over the buffers left out: mutant hc31.
    """
    monkeypatch.setattr("rsibr.validation.metrics.flip_map", lambda reference, *_: np.zeros(reference.shape[:2]))
    truth = smooth_map(24)
    for noise in (0.003, 0.03):
        found = [compare(truth, noisy_reference(truth, noise, rng), EXPOSURES).rel_mse for _ in range(100)]
        assert sum(low <= 0 <= high for low, high in (estimate.ci95 for estimate in found)) >= 84
        assert sum(estimate.below_noise_floor for estimate in found) >= 84


def damaged(damage):
    truth = smooth_map(96)
    truth[30:32, 40:42] = 1000.0  # a sun
    candidate = truth.copy()
    if damage == "firefly":
        candidate[60, 50] = 1e4
    elif damage == "hole":
        candidate[50:60, 45:55] = 0.0
    else:
        candidate[30:32, 40:42] = 1.0
    return truth, candidate


SEEN_BY = {
    "firefly": {"rel_mse": 1e3, "worst_texel": 1e6, "energy_ratio": 0.1},
    "hole": {"smape": 0.01, "worst_texel": 0.25, "flip": 0.005},
    "sun": {"worst_texel": 0.25, "energy_ratio": 0.2},
}
"""For each damage the headline numbers that must see it, and how far from perfect they must at least be."""


@pytest.mark.parametrize("damage", SEEN_BY)
def test_hc32_headline_numbers_see(damage, rng):
    """One firefly of 1e4, a hole of 10×10 black texels, a sun that is lost: each by the numbers named above.

    The undamaged map, under the same 2 % of noise, shows less by a third.
    Fails when the mean over texels is a median, the worst texel is not the worst, or bright texels are
    clamped: mutants hc32.
    """
    truth, candidate = damaged(damage)
    reference = noisy_reference(truth, 0.02, rng)

    def numbers(image):
        error = compare(image, reference, EXPOSURES)
        return {
            "rel_mse": error.rel_mse.value,
            "smape": error.smape,
            "flip": error.flip,
            "energy_ratio": abs(error.energy_ratio - 1),
            "worst_texel": error.worst_texel.error,
        }

    sound, seen = numbers(truth), numbers(candidate)
    for name, least in SEEN_BY[damage].items():
        assert seen[name] > least
        assert seen[name] > 1.5 * sound[name]


def slow_map(_frame, resolution):
    """A map that takes its time: a long loop over few lanes, handed out before it has run."""
    steps = dr.opaque(mi.UInt32, 200_000)
    _, value = dr.while_loop(
        state=(mi.UInt32(0), dr.full(mi.Float, 0.5, resolution**2)),
        cond=lambda step, _: step < steps,
        body=lambda step, x: (step + 1, dr.sin(x) + 0.7),
        labels=("step", "value"),
    )
    return mi.TensorXf(dr.repeat(value, 4), (resolution, resolution, 4))


def test_hc33_a_reconstruction_is_timed_until_the_device_has_finished():
    """A kernel of a tenth of a second and more: the time told is at least half of what waiting for it takes.

    Without the wait it is the time of a launch, a hundredth of that.
    Fails when the device is not waited for: mutant hc33.
    """

    def waited():
        start = time.perf_counter()
        dr.eval(slow_map(None, 16))
        dr.sync_thread()
        return time.perf_counter() - start

    waited()  # compiles
    shortest = min(waited() for _ in range(3))
    slow = SimpleNamespace(map=slow_map, name="slow", cost=Cost())
    told = max(reconstruction.run(slow, view_frame([0, 0, 1]), 16).seconds for _ in range(3))
    assert shortest > 0.02
    assert told > 0.5 * shortest


@pytest.fixture
def events(monkeypatch):
    """What happens in a timed region, in order: clock, render, sync."""
    log = []

    def logged(name, call):
        return lambda *arguments, **options: (log.append(name), call(*arguments, **options))[1]

    monkeypatch.setattr(backend, "synchronize", logged("sync", backend.synchronize))
    monkeypatch.setattr(dr, "eval", logged("eval", dr.eval))
    monkeypatch.setattr(mi, "render", logged("render", mi.render))
    for module in (reconstruction, reference_module):
        monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=logged("clock", time.perf_counter)))
    return log


def test_hc33_the_clock_of_a_reconstruction_is_read_after_the_wait(events):
    """Clock, evaluation, wait, clock, in this order and nothing after the wait.

    Fails when the device is not waited for: mutant hc33.
    """
    made = method(resolution=8)
    events.clear()
    reconstruction.run(made, view_frame([0, 0, 1]), 8)
    assert events[0] == "clock"
    assert events[-3:] == ["eval", "sync", "clock"]


def test_hc33_the_clock_of_a_reference_is_read_after_the_wait(events):
    """The warm-up's compilation apart; then clock, eight renderings, wait, clock.

    Fails when the device is not waited for: mutant hc33.
    """
    renderer = ReferenceRenderer(GREY_SKY, MIRROR, 8)
    events.clear()
    renderer.render(view_frame((0, 0, 1)), 8)
    timed = [event for event in events if event != "eval"]
    assert timed == ["clock", "render", "sync", "clock", "clock", *["render"] * 8, "sync", "clock"]
