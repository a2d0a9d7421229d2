"""Number and allocation of the samples of a bake, decided once before its first view, and recorded."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rsibr.baking.allocation import Allocation, equal_work
from rsibr.baking.blocks import FEW_BLOCKS, MAX_BLOCKS, Blocks, block_sizes
from rsibr.baking.calibration import map_overhead, sample_seconds
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.lattice import MAX_POINTS
from rsibr.baking.noise_pilot import Image, NoisePilot
from rsibr.baking.texel_pilot import TexelNoise, TexelPilot
from rsibr.errors import InputError
from rsibr.scene.config import SamplingConfig
from rsibr.store.manifest import SamplingRecord

NOISE_MARGIN = 1.1
"""Least safety factor on the measured noise of a block; see `_margin`."""

CONFIDENCE = 2.0
"""Standard errors of the measured noise that a target error is met with."""

CLOSE = 0.9
"""Share of a target, safety factor included, from which the search for the size of a block ends."""

AIM = 0.96
"""Share of a target that the search aims at from below."""

STRATIFIED = 1.2
"""Exponent with which the noise of a block typically falls with its size."""

REFINEMENTS = 5
"""Maximum measurements in search of the block size of a target error."""

TIME_MARGIN = 0.9
"""Share of a time budget that the forecast may use."""

AFTER_PILOTS = 0.6
"""Minimum share of a time budget that remains for samples after pilots and timing."""

TYPICAL_SIZE = 16
"""Initial samples a block where the number of samples is not known yet."""

SIZES = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096)
"""Block sizes to choose from if the number of samples is free; lattices of these sizes are among the best."""

MAX_SAMPLES = 2**24
LEAST_SAMPLES = 4


@dataclass(frozen=True)
class Steering:
    """Thresholds above which samples are allocated adaptively, by noise.

    Attributes
    ----------
    worth_it : float
        Predicted ratio of the noise of uniform to that of adaptive allocation above which the latter is used. Below,
        the cost of the pilot and the error of the prediction outweigh the gain.
    least_work : int
        Samples a view below which no pilot is rendered, because it would take longer than it saves.
    few_blocks : int
        Blocks a texel of uniform allocation if the block size is free.
    """

    worth_it: float = 1.15
    least_work: int = 2**19
    few_blocks: int = FEW_BLOCKS


@dataclass(eq=False)
class Sampler:
    """Choose the samples of a bake and of each view.

    Attributes
    ----------
    integrator : SphereIntegrator
        Integrator of the bake.
    frames : sequence of ndarray, shape (3, 3)
        Frames of all views.
    config : SamplingConfig
        Requested samples, target error or time budget.
    steering : Steering
        Thresholds of adaptive allocation.
    """

    integrator: SphereIntegrator
    frames: Sequence[NDArray[np.float64]]
    config: SamplingConfig
    steering: Steering = Steering()
    _pilot: NoisePilot | None = None
    _looks: dict[int, Image] = field(default_factory=dict)

    def choose(self, begun: float) -> SamplingRecord:
        """Choose number and allocation of the samples.

        Parameters
        ----------
        begun : float
            Start of the bake, by `time.perf_counter`; a time budget counts from it.

        Raises
        ------
        InputError
            If no number of samples meets the target error or the time budget.
        """
        if self.config.target_error is not None:
            record = self._for_error(self.config.target_error)
        elif self.config.time_budget_s is not None:
            record = self._for_seconds(self.config.time_budget_s, begun)
        else:
            record = self._as_given(block_sizes(self.config.count))
        return record.model_copy(update={"seconds": max(0.0, time.perf_counter() - begun)})

    def blocks(self, record: SamplingRecord, index: int) -> Blocks:
        """Blocks of each texel of a view: a function of the record, hence the same in a resumed bake."""
        if record.scale is None:
            return Blocks(record.block, record.even)
        pilot = self._pilot_for(record.block)
        spread = pilot.enlarged(self._look(pilot, index))
        return Blocks(record.block, Allocation(record.even, record.scale).counts(spread))

    @property
    def _texels(self) -> int:
        return int(np.count_nonzero(self.integrator.coverage))

    def _as_given(self, blocks: Blocks) -> SamplingRecord:
        even = int(blocks.counts)
        worth_a_pilot = even >= MAX_BLOCKS and self._texels * blocks.size * even >= self.steering.least_work
        if not (self.config.adaptive and worth_a_pilot):
            return SamplingRecord(block=blocks.size, even=even)
        return self._allocated(blocks.size, even, self._spread(blocks.size))

    def _allocated(self, size: int, even: int, spread: NDArray[np.float64]) -> SamplingRecord:
        """Adaptive allocation, or uniform if the predicted gain is below the threshold."""
        plain = Allocation(even)
        noise = plain.noise(spread)
        if not self.config.adaptive or even < MAX_BLOCKS or not spread.any():
            return SamplingRecord(block=size, even=even, forecast_rel_mse=noise)
        steered = equal_work(even, spread)
        gain = noise / steered.noise(spread)
        chosen = steered if gain > self.steering.worth_it else plain
        return SamplingRecord(
            block=size, even=even, scale=chosen.scale, gain=gain, forecast_rel_mse=chosen.noise(spread)
        )

    def _for_error(self, target: float) -> SamplingRecord:
        """Samples that keep a target: estimated from small maps, then corrected by the noise of the bake's own texels.

        With uniform allocation few blocks are enough, and their size is free; with adaptive allocation their number is.
        """
        needed, again, least = self._fewest(target)
        pilot = TexelPilot(self.integrator, self.frames, self.config.seed)
        record = None
        if again.scale is not None:
            record = self._shared_out(pilot, again, least, target)
        if record is None:
            size = min(MAX_POINTS, max(again.block, math.ceil(needed / least)))
            record = _uniform(pilot, size, self.steering.few_blocks, target)
        return record.model_copy(update={"gain": again.gain, "promised_rel_mse": target})

    def _shared_out(self, pilot: TexelPilot, again: SamplingRecord, least: int, target: float) -> SamplingRecord | None:
        """Adaptive allocation that keeps a target by the noise of the bake's own texels; None if it does not pay."""
        factor, even = 1.0, least
        for step in range(REFINEMENTS):
            if again.scale is None:
                return None
            found, maps = pilot.look(again.block), self._pilot_for(again.block)
            spread = np.array([maps.enlarged(self._look(maps, k))[texels] for k, texels in enumerate(found.texels)])
            noise, factor, even = _blocks_for(found, spread, again.scale, least, target)
            smaller = max(LEAST_SAMPLES, math.ceil(again.block * factor ** (1 / STRATIFIED)))
            if factor >= CLOSE or smaller >= again.block or step == REFINEMENTS - 1:
                break
            again = self._allocated(smaller, least, self._spread(smaller))  # `least` blocks of this size are too many
        _check_within_reach(float(even * again.block), target)
        scale = (again.scale or 0.0) * max(1.0, factor)
        return SamplingRecord(block=again.block, even=even, scale=scale, forecast_rel_mse=noise)

    def _fewest(self, target: float) -> tuple[float, SamplingRecord, int]:
        """Choose between few large blocks (fine lattices, uniform) and many small ones (adaptive): fewer samples win.

        Returns
        -------
        needed : float
            Samples a texel that keep the noise below the target.
        record, least
            Allocation, and its number of blocks a texel.
        """
        typical = self._allocated(TYPICAL_SIZE, MAX_BLOCKS, self._spread(TYPICAL_SIZE))
        _check_within_reach(_needed(typical, target), target)
        ways = []
        # Many blocks last: only these need their pilots again during the bake, and the last pilots stay cached
        few = self.steering.few_blocks
        for least in (few,) if typical.scale is None or few == MAX_BLOCKS else (few, MAX_BLOCKS):
            size = _size_for(_needed(typical, target), least)
            record = self._allocated(size, least, self._spread(size))
            ways.append((_needed(record, target), record, least))
        return min(reversed(ways), key=lambda way: way[0])

    def _for_seconds(self, allowed: float, begun: float) -> SamplingRecord:
        size = _size_for(AFTER_PILOTS * self._affordable(TYPICAL_SIZE, allowed, begun))
        spread = self._spread(size)
        affordable = self._affordable(size, allowed, begun)
        if affordable < LEAST_SAMPLES:
            raise InputError(
                f"{allowed:g} s are too few for {len(self.frames)} maps of {self.integrator.coverage.shape[0]}²",
                where="sampling.time_budget_s",
                fix=f"allow for {math.ceil(2 * allowed + 1)} s or more, or lower map.resolution",
            )
        even = max(2, int(affordable / size))
        record = self._allocated(size, even, spread)
        return record.model_copy(update={"promised_seconds": allowed})

    def _affordable(self, size: int, allowed: float, begun: float) -> float:
        """Samples a texel that fit into the remaining time."""
        overhead = len(self.frames) * map_overhead(self.integrator)
        rate = sample_seconds(self.integrator, size)
        left = TIME_MARGIN * allowed - (time.perf_counter() - begun) - overhead
        return min(MAX_SAMPLES, left / (rate * self._texels * len(self.frames)))

    def _spread(self, size: int) -> NDArray[np.float64]:
        """Relative standard deviation of a block for the texels of all views, from a pilot of each view."""
        pilot = self._pilot_for(size)
        return np.concatenate([pilot.spread(self._look(pilot, index)) for index in range(len(self.frames))])

    def _pilot_for(self, size: int) -> NoisePilot:
        if self._pilot is None or self._pilot.size != size:
            self._pilot = NoisePilot(self.integrator, size, self.config.seed)
            self._looks.clear()
        return self._pilot

    def _look(self, pilot: NoisePilot, index: int) -> Image:
        if index not in self._looks:
            self._looks[index] = pilot.look(self.frames[index], index)
        return self._looks[index]


def _needed(record: SamplingRecord, target: float) -> float:
    """Samples a texel that keep the noise below the target; relMSE is inversely proportional to them."""
    return (record.forecast_rel_mse or 0.0) / target * record.even * record.block


def _blocks_for(
    found: TexelNoise, spread: NDArray[np.float64], scale: float, least: int, target: float
) -> tuple[float, float, int]:
    """Adaptive blocks that keep a target: their noise, their number over `least`, and its mean for `Allocation`."""
    factor, even, noise = 1.0, least, 0.0
    for _ in range(REFINEMENTS):  # counts are whole numbers between bounds: noise is not quite inverse to them
        noise = found.mean(Allocation(even, scale * max(1.0, factor)).counts(spread).astype(np.float64))
        factor *= noise * _margin(found) / target
        even = max(least, math.ceil(least * factor))
        if factor <= 1:
            break
    return noise, factor, even


def _uniform(pilot: TexelPilot, size: int, least: int, target: float) -> SamplingRecord:
    """Uniform allocation of `least` blocks whose size keeps a target; of more blocks where no measured size does.

    Noise falls with the size of a block faster than with their number, because a block is stratified; but not evenly,
    because lattices of neighbouring sizes differ. The chosen size is therefore one that was measured.
    """
    upper: dict[int, float] = {}  # confidence bound of the noise of a block, by its size
    noise: dict[int, float] = {}
    for _ in range(REFINEMENTS):
        found = pilot.look(size)
        noise[size], upper[size] = found.mean(), found.mean() * _margin(found)
        missed = upper[size] / (target * least)
        if CLOSE <= missed <= 1 or (missed < CLOSE and size == LEAST_SAMPLES):
            break
        aim = missed if missed > 1 else missed / AIM  # from below, not beyond the target again
        size = min(MAX_POINTS, max(LEAST_SAMPLES, math.ceil(size * aim ** (1 / STRATIFIED))))
        if size in noise:
            break
    counts = {one: max(least, math.ceil(bound / target)) for one, bound in upper.items()}
    size = min(counts, key=lambda one: one * counts[one])
    even = counts[size]
    _check_within_reach(float(size * even), target)
    return SamplingRecord(block=size, even=even, forecast_rel_mse=noise[size] / even)


def _margin(found: TexelNoise) -> float:
    """Safety factor on a measured noise: its upper confidence bound."""
    return max(NOISE_MARGIN, 1 + CONFIDENCE * found.error)


def _check_within_reach(needed: float, target: float) -> None:
    if needed > MAX_SAMPLES:
        raise InputError(
            f"noise of {target:g} (relMSE) would take {needed:.2g} samples a texel; "
            f"the best that {MAX_SAMPLES} can promise is {target * needed / MAX_SAMPLES:.2g}",
            where="sampling.target_error",
            fix="allow for more error",
        )


def _size_for(samples: float, blocks: int = MAX_BLOCKS) -> int:
    """Largest block size of `SIZES` with at least `blocks` blocks in `samples`."""
    return max((size for size in SIZES if size * blocks <= samples), default=SIZES[0])
