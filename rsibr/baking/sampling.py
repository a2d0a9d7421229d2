"""How many samples a bake takes, and where: decided once, before its first view, and recorded."""

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
from rsibr.baking.noise_pilot import LEAST_SIDE, Image, NoisePilot
from rsibr.errors import InputError
from rsibr.scene.config import SamplingConfig
from rsibr.store.manifest import SamplingRecord

NOISE_MARGIN = 1.1
"""Predicted noise of a bake to the one promised: the prediction is right to a few per cent, and rather too high."""

PROMISING_SIDE = 32
"""Texels of a pilot along a side at least where an error is promised."""

TIME_MARGIN = 0.9
"""Forecast seconds to those allowed."""

AFTER_PILOTS = 0.6
"""Share of the seconds that is left for samples, at least, once pilots and a sample's time have been measured."""

TYPICAL_SIZE = 16
"""Samples of a block to begin with where their count is still to be found."""

SIZES = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096)
"""Samples of a block that are chosen from where their count is free: lattices of these are among the best."""

MAX_SAMPLES = 2**24
LEAST_SAMPLES = 4


@dataclass(frozen=True)
class Steering:
    """From where on samples are shared out by noise, and not evenly.

    Attributes
    ----------
    worth_it : float
        Predicted ratio of the noise of even samples to that of allocated ones above which they are allocated: below,
        the pilot, the odd launches and what the prediction is off by leave nothing to win.
    least_work : int
        Samples of a view below which no pilot is made to allocate them: its launch would take longer than it saves.
    few_blocks : int
        Blocks a texel where their size is free and samples are even.
    """

    worth_it: float = 1.15
    least_work: int = 2**19
    few_blocks: int = FEW_BLOCKS


@dataclass(eq=False)
class Sampler:
    """Chooses the samples of a bake, and hands each view its own.

    Attributes
    ----------
    integrator : SphereIntegrator
        That of the bake.
    frames : sequence of ndarray, shape (3, 3)
        Frames of all its views.
    config : SamplingConfig
        What is asked for.
    steering : Steering
    """

    integrator: SphereIntegrator
    frames: Sequence[NDArray[np.float64]]
    config: SamplingConfig
    steering: Steering = Steering()
    _pilot: NoisePilot | None = None
    _looks: dict[int, Image] = field(default_factory=dict)

    def choose(self, begun: float) -> SamplingRecord:
        """Decide.

        Parameters
        ----------
        begun : float
            When the bake began, by `time.perf_counter`: a budget of seconds runs from there.

        Raises
        ------
        InputError
            If no count of samples keeps what is asked for.
        """
        if self.config.target_error is not None:
            record = self._for_error(self.config.target_error)
        elif self.config.time_budget_s is not None:
            record = self._for_seconds(self.config.time_budget_s, begun)
        else:
            record = self._as_given(block_sizes(self.config.count))
        return record.model_copy(update={"seconds": max(0.0, time.perf_counter() - begun)})

    def blocks(self, record: SamplingRecord, index: int) -> Blocks:
        """Blocks of each texel of a view; the same whether or not the choice was made in this process."""
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
        """Samples where the noise is, or evenly where that is worth nothing."""
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
        needed, again, least, spread = self._fewest(target)
        if again.scale is None:  # a finer lattice is no noisier, so that no block need be left half used
            size, scale = min(MAX_POINTS, max(again.block, math.ceil(needed / least))), None
            even = max(least, math.ceil(needed / size))
        else:
            size, even = again.block, max(least, math.ceil(needed / again.block))
            scale = again.scale * even / least
        noise = Allocation(even, scale).noise(spread) * again.block / size
        return SamplingRecord(
            block=size, even=even, scale=scale, gain=again.gain, forecast_rel_mse=noise, promised_rel_mse=target
        )

    def _fewest(self, target: float) -> tuple[float, SamplingRecord, int, NDArray[np.float64]]:
        """Few large blocks for all, whose strata are fine, or many small ones to share out: whichever takes less.

        Returns
        -------
        needed : float
            Samples a texel that keep the noise below the target.
        record, least, spread
            How they are taken, of so many blocks a texel; and the spread of the texels.
        """
        typical = self._allocated(TYPICAL_SIZE, MAX_BLOCKS, self._spread(TYPICAL_SIZE))
        _check_within_reach(_needed(typical, target), target)
        ways = []
        # The many come last: only they need their pilots again, which are kept till then
        few = self.steering.few_blocks
        for least in (few,) if typical.scale is None or few == MAX_BLOCKS else (few, MAX_BLOCKS):
            size = _size_for(_needed(typical, target), least)
            spread = self._spread(size)
            record = self._allocated(size, least, spread)
            ways.append((_needed(record, target), record, least, spread))
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
        """Samples a texel that the seconds left allow for."""
        overhead = len(self.frames) * map_overhead(self.integrator)
        rate = sample_seconds(self.integrator, size)
        left = TIME_MARGIN * allowed - (time.perf_counter() - begun) - overhead
        return min(MAX_SAMPLES, left / (rate * self._texels * len(self.frames)))

    def _spread(self, size: int) -> NDArray[np.float64]:
        """Spread of the texels of all views, from a pilot of each."""
        pilot = self._pilot_for(size)
        return np.concatenate([pilot.spread(self._look(pilot, index)) for index in range(len(self.frames))])

    def _pilot_for(self, size: int) -> NoisePilot:
        if self._pilot is None or self._pilot.size != size:
            least_side = LEAST_SIDE if self.config.target_error is None else PROMISING_SIDE
            self._pilot = NoisePilot(self.integrator, size, self.config.seed, least_side)
            self._looks.clear()
        return self._pilot

    def _look(self, pilot: NoisePilot, index: int) -> Image:
        if index not in self._looks:
            self._looks[index] = pilot.look(self.frames[index], index)
        return self._looks[index]


def _needed(record: SamplingRecord, target: float) -> float:
    """Samples a texel that keep the noise below the target: relMSE goes with their inverse."""
    return NOISE_MARGIN * (record.forecast_rel_mse or 0.0) / target * record.even * record.block


def _check_within_reach(needed: float, target: float) -> None:
    if needed > MAX_SAMPLES:
        raise InputError(
            f"noise of {target:g} (relMSE) would take {needed:.2g} samples a texel; "
            f"the best that {MAX_SAMPLES} can promise is {target * needed / MAX_SAMPLES:.2g}",
            where="sampling.target_error",
            fix="allow for more error",
        )


def _size_for(samples: float, blocks: int = MAX_BLOCKS) -> int:
    """Samples of a block so that at least `blocks` of them are taken, one of `SIZES`."""
    return max((size for size in SIZES if size * blocks <= samples), default=SIZES[0])
