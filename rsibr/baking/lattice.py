"""Random numbers of a block of samples: a randomly shifted rank-1 lattice.

A lattice is stratified in all dimensions jointly. A BSDF sample takes three dimensions, one of which selects the lobe;
stratifying pairs of dimensions does not reduce the noise of that selection. A random shift, drawn for each block and
each dimension, makes every point uniformly distributed. The mean of a block is therefore unbiased, and blocks are
independent: Cranley & Patterson (1976), *Randomization of Number Theoretic Methods for Multiple Integration*.
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
"""Maximum points of a lattice; beyond, more lattices reduce noise as much as finer ones."""

_COUPLING = 0.3
"""Weight of all dimensions except the two of a direction: radiance varies most with direction, little over a texel."""

_CANDIDATES = 256
"""Components tried for each dimension; more candidates hardly improve the best."""

_GOLDEN = 0x9E3779B9
"""Difference between the seeds of the pairs of dimensions of one launch; the seeds of launches are random."""


_ROUNDS = 8
"""Rounds of the hash that gives the shifts. With Mitsuba's 4, shifts of neighbouring blocks correlate by up to 0.5."""


class Generator(NamedTuple):
    """Generating vector z of a lattice, by the use of its dimensions: point k is k·z/n mod 1."""

    direction: tuple[int, int]
    choice: int
    wavelength: int
    texel: tuple[int, int]


@cache
def generator(points: int) -> Generator:
    """Construct a good lattice component by component.

    Parameters
    ----------
    points : int
        Points n of the lattice, 1 to `MAX_POINTS`.

    Notes
    -----
    Each component minimises the worst-case error in a weighted Korobov space of smoothness 2: the mean over the points
    of Π (1 + γ 2π² B₂(x)), with the Bernoulli polynomial B₂. Sloan & Reztsov (2002), *Component-by-component
    construction of good lattice rules*. The pair of coordinates in a texel is added as a separate term, because their
    weights give their product little influence.
    """
    # ---- Candidates: coprime to n, at most `_CANDIDATES` of them ----
    candidates = [z for z in range(1, max(2, points // 2 + 1)) if math.gcd(z, points) == 1]
    candidates = candidates[:: -(-len(candidates) // _CANDIDATES)]
    # ---- Worst-case error: factors 1 + γ 2π² B₂(x) ----
    k = np.arange(points)
    x = k / points
    bernoulli = 2 * math.pi**2 * (x * x - x + 1 / 6)

    def factor(z: int, weight: float = _COUPLING) -> NDArray[np.float64]:
        return np.asarray(1 + weight * bernoulli[k * z % points])

    def best(product: NDArray[np.float64], weight: float = _COUPLING, pair: NDArray[np.float64] | float = 0.0) -> int:
        return min(candidates, key=lambda z: float((product * factor(z, weight) + pair * factor(z, 1.0)).mean()))

    # ---- Components: direction, choice of lobe, wavelength, point in the texel ----
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
    """Randomly shifted lattices of many blocks, one point a lane.

    Parameters
    ----------
    points : int
        Points of each lattice, 1 to `MAX_POINTS`.
    block : mi.UInt32
        Index of the block of each lane.
    index : mi.UInt32
        Index of the point in its block.
    seed : mi.UInt32
        Determines the shifts; opaque, so that all seeds share a kernel.
    """

    def __init__(self, points: int, block: mi.UInt32, index: mi.UInt32, seed: mi.UInt32) -> None:
        self._points, self._block, self._index, self._seed = points, block, index, seed
        self._generator = generator(points)

    def in_texel(self) -> mi.Point2f:
        """Position of the sample in its texel, in [0, 1)²."""
        return mi.Point2f(*self._shifted(self._generator.texel, 0))

    def toward_light(self) -> mi.Point2f:
        """Random numbers for emitter sampling."""
        return mi.Point2f(*self._shifted(self._generator.direction, 1))

    def of_lobe(self) -> tuple[mi.Float, mi.Point2f]:
        """Random numbers for BSDF sampling: selection of a lobe, and direction."""
        choice, _ = self._shifted((self._generator.choice, self._generator.wavelength), 2)
        return choice, mi.Point2f(*self._shifted(self._generator.direction, 3))

    def of_wavelengths(self) -> mi.Float:
        """Random number for the wavelengths."""
        return self._shifted((self._generator.choice, self._generator.wavelength), 2)[1]

    def _shifted(self, components: tuple[int, int], pair: int) -> tuple[mi.Float, mi.Float]:
        """Two coordinates in [0, 1), with the shifts of pair `pair` of dimensions."""
        first, second = mi.sample_tea_32(self._block, self._seed + mi.UInt32(pair * _GOLDEN % 2**32), _ROUNDS)
        return self._coordinate(components[0], first), self._coordinate(components[1], second)

    def _coordinate(self, component: int, shift: mi.UInt32) -> mi.Float:
        """Coordinate in fixed point; integer overflow takes it modulo 1."""
        step = dr.opaque(mi.UInt32, round(2**32 * component / self._points) % 2**32)
        return mi.Float((self._index * step + shift) >> 8) * 2**-24
