"""Tables of a paint's layers, evaluated at the channels or the wavelengths of a sample.

In RGB a table holds one value a channel. In spectral variants the layers are solved at the wavelengths `NODES`, and
tables over directions are compressed by a singular value decomposition to a few functions whose weighted sum gives the
table of any wavelength, with a relative error of 1e-4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device

Array = NDArray[np.float64]

NODES = np.linspace(360.0, 830.0, 48)
"""Wavelengths [nm] at which a paint is solved in spectral rendering; linear between them."""

_RANKS = {"entry": 3, "between": 4}  # with the coat's albedo the first has four channels: one lookup


@dataclass(frozen=True)
class PaintColours:
    """Paint at the channels or wavelengths of a sample.

    Attributes
    ----------
    diffuse, flakes, retro, depth : mi.UnpolarizedSpectrum
        See `CoatTables.diffuse`, and `PaintRecipe`.
    entry, between : callable
        Map the channels of the tables over directions to a value.
    """

    diffuse: mi.UnpolarizedSpectrum
    flakes: mi.UnpolarizedSpectrum
    retro: mi.UnpolarizedSpectrum
    depth: mi.UnpolarizedSpectrum
    entry: Callable[[list[mi.Float]], mi.UnpolarizedSpectrum]
    between: Callable[[list[mi.Float]], mi.UnpolarizedSpectrum]


class PaintSpectra:
    """Colours of a paint, and its tables over directions, compressed in spectral variants.

    Parameters
    ----------
    diffuse, flakes, retro, depth : iterable of C floats
        A value for each channel, or each of `NODES`.
    entry, between : ndarray, shape (…, C)
        Tables over directions.

    Attributes
    ----------
    entry, between : ndarray, shape (…, at most 4)
        Channels of the tables over directions.
    """

    def __init__(
        self,
        diffuse: Iterable[float],
        flakes: Iterable[float],
        retro: Iterable[float],
        depth: Iterable[float],
        entry: Array,
        between: Array,
    ) -> None:
        colours = np.stack([np.array([*row]) for row in (diffuse, flakes, retro, depth)])
        self._spectral = bool(mi.is_spectral)
        if self._spectral:
            by_entry, self.entry = _compressed(entry - 1, _RANKS["entry"])  # without the direct light, which is 1
            by_between, self.between = _compressed(between, _RANKS["between"])
            self._table = lookup_table(np.column_stack([colours.T, by_entry, by_between]), 1)
        else:
            self.entry, self.between = entry, between
            self._constant = [opaque_colour(row) for row in colours]

    def at(self, si: mi.SurfaceInteraction3f) -> PaintColours:
        """Return the paint at the channels or wavelengths of `si`."""
        if not self._spectral:
            diffuse, flakes, retro, depth = self._constant
            return PaintColours(diffuse, flakes, retro, depth, _as_they_are, _as_they_are)
        place = (si.wavelengths - float(NODES[0])) / float(NODES[-1] - NODES[0])
        rows = [self._table.eval(along(position, len(NODES))) for position in place]
        by_value = [mi.UnpolarizedSpectrum([row[k] for row in rows]) for k in range(4 + sum(_RANKS.values()))]
        diffuse, flakes, retro, depth = by_value[:4]
        entry, between = by_value[4 : 4 + _RANKS["entry"]], by_value[4 + _RANKS["entry"] :]
        return PaintColours(
            diffuse,
            flakes,
            retro,
            depth,
            lambda held: 1 + _combined(entry, held),
            lambda held: dr.maximum(_combined(between, held), 0),
        )


def along(position: mi.Float, nodes: int) -> mi.Float:
    """Texture coordinate of a position in [0, 1] between the centres of the first and the last of `nodes` texels."""
    return (position * (nodes - 1) + 0.5) / nodes


def lookup_table(values: Array, dimensions: int) -> mi.Texture1f | mi.Texture3f:
    """Table with linear interpolation in float32; channels are padded to multiples of four, one packet each."""
    channels = values.shape[-1]
    padded = np.zeros((*values.shape[:dimensions], -(-channels // 4) * 4), dtype=np.float32)
    padded[..., :channels] = values
    kind = {1: mi.Texture1f, 3: mi.Texture3f}[dimensions]
    if not dr.is_jit_v(mi.Float):
        return kind(mi.TensorXf(padded))
    return kind(mi.TensorXf(to_device(mi.Float, padded), shape=padded.shape), use_accel=False)


def opaque_colour(values: Iterable[float]) -> mi.UnpolarizedSpectrum:
    """Opaque colour, so that all colours share a kernel."""
    colour = mi.UnpolarizedSpectrum([float(v) for v in values])
    dr.make_opaque(colour)
    return colour


def _as_they_are(held: list[mi.Float]) -> mi.UnpolarizedSpectrum:
    return mi.UnpolarizedSpectrum(held[: dr.size_v(mi.UnpolarizedSpectrum)])


def _combined(weights: list[mi.UnpolarizedSpectrum], held: list[mi.Float]) -> mi.UnpolarizedSpectrum:
    total = mi.UnpolarizedSpectrum(0)
    for weight, value in zip(weights, held, strict=False):  # the padding of the table is not used
        total += weight * value
    return total


def _compressed(table: Array, rank: int) -> tuple[Array, Array]:
    """Weights (C, rank) and functions (…, rank) of the best rank approximation to a table of shape (…, C)."""
    functions, sizes, weights = np.linalg.svd(table.reshape(-1, table.shape[-1]), full_matrices=False)
    return (weights[:rank] * sizes[:rank, None]).T, functions[:, :rank].reshape(*table.shape[:-1], rank)
