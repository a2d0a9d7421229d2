"""The random numbers of a block of samples: a rank-1 lattice, shifted at random.

The points of a lattice are spread evenly in all dimensions at once. A sample of the BSDF takes three, of which one
picks the lobe: strata of pairs of dimensions leave the noise of that choice as it is. A shift, drawn anew for each
block and each dimension, makes every point uniform, so that the mean of a block is unbiased, and blocks independent:
Cranley & Patterson (1976), *Randomization of Number Theoretic Methods for Multiple Integration*.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

MAX_POINTS = 4096
"""Points of a lattice at most: beyond, further lattices gain as much as finer ones."""

_COUPLING = 0.3
"""Weight of every dimension beside the two of a direction: light varies most over directions, over a texel little."""

_CANDIDATES = 256
"""Components that are tried for each dimension: of more, the best is hardly better."""

_GOLDEN = 0x9E3779B9
"""Distance of the seeds of the pairs of one launch; those of launches are random numbers."""


_ROUNDS = 8
"""Of the hash that shifts come from: by Mitsuba's four, those of neighbouring blocks correlate up to 0.5."""


class Generator(NamedTuple):
    """Components of the vector that generates a lattice, by what the dimension is used for: point k is k·z/n mod 1."""

    direction: tuple[int, int]
    choice: int
    wavelength: int
    texel: tuple[int, int]


@cache
def generator(points: int) -> Generator:
    """Search for a good lattice, a component at a time.

    Parameters
    ----------
    points : int
        Points n of the lattice, 1 to `MAX_POINTS`.

    Notes
    -----
    Each component makes the worst-case error of a weighted Korobov space of smoothness 2 least: the mean over the
    points of Π (1 + γ 2π² B₂(x)), with Bernoulli's polynomial B₂. Sloan & Reztsov (2002), *Component-by-component
    construction of good lattice rules*. The two coordinates in a texel count once more as a pair by themselves, for
    their weights make little of their product.
    """
    candidates = [z for z in range(1, max(2, points // 2 + 1)) if math.gcd(z, points) == 1]
    candidates = candidates[:: -(-len(candidates) // _CANDIDATES)]
    k = np.arange(points)
    x = k / points
    bernoulli = 2 * math.pi**2 * (x * x - x + 1 / 6)

    def factor(z: int, weight: float = _COUPLING) -> NDArray[np.float64]:
        return np.asarray(1 + weight * bernoulli[k * z % points])

    def best(product: NDArray[np.float64], weight: float = _COUPLING, pair: NDArray[np.float64] | float = 0.0) -> int:
        return min(candidates, key=lambda z: float((product * factor(z, weight) + pair * factor(z, 1.0)).mean()))

    product = factor(1, 1.0)
    second = best(product, 1.0)
    product *= factor(second, 1.0)
    choice = best(product)
    product *= factor(choice)
    wavelength = best(product)
    product *= factor(wavelength)
    across = best(product)
    down = best(product * factor(across), pair=factor(across, 1.0))
    return Generator((1, second), choice, wavelength, (across, down))


class ShiftedLattice:
    """Lattices of many blocks, one point a lane.

    Parameters
    ----------
    points : int
        Points of each lattice, 1 to `MAX_POINTS`.
    block : mi.UInt32
        Which block each lane belongs to.
    index : mi.UInt32
        Which of the block's points it is.
    seed : mi.UInt32
        Fixes the shifts; opaque, lest every seed compile a kernel.
    """

    def __init__(self, points: int, block: mi.UInt32, index: mi.UInt32, seed: mi.UInt32) -> None:
        self._points, self._block, self._index, self._seed = points, block, index, seed
        self._generator = generator(points)

    def in_texel(self) -> mi.Point2f:
        """Where in its texel the sample lies."""
        return mi.Point2f(*self._shifted(self._generator.texel, 0))

    def toward_light(self) -> mi.Point2f:
        """What the direction to the light is drawn by."""
        return mi.Point2f(*self._shifted(self._generator.direction, 1))

    def of_lobe(self) -> tuple[mi.Float, mi.Point2f]:
        """What a lobe of the BSDF is chosen by, and what a direction in it is drawn by."""
        choice, _ = self._shifted((self._generator.choice, self._generator.wavelength), 2)
        return choice, mi.Point2f(*self._shifted(self._generator.direction, 3))

    def of_wavelengths(self) -> mi.Float:
        """What the wavelengths are drawn by."""
        return self._shifted((self._generator.choice, self._generator.wavelength), 2)[1]

    def _shifted(self, components: tuple[int, int], pair: int) -> tuple[mi.Float, mi.Float]:
        """Two coordinates in [0, 1), with a shift of their own."""
        first, second = mi.sample_tea_32(self._block, self._seed + mi.UInt32(pair * _GOLDEN % 2**32), _ROUNDS)
        return self._coordinate(components[0], first), self._coordinate(components[1], second)

    def _coordinate(self, component: int, shift: mi.UInt32) -> mi.Float:
        """Coordinate in fixed point: what overflows is the whole part."""
        step = dr.opaque(mi.UInt32, round(2**32 * component / self._points) % 2**32)
        return mi.Float((self._index * step + shift) >> 8) * 2**-24
