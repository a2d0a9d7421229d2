"""Spectra of given linear RGB colours, for radiance of bakes in Mitsuba's spectral variants."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.to_device import to_device

_NODES = np.linspace(360.0, 830.0, 95)
_LUMINANCE_OF_ONE = 106.7502593994140625  # Mitsuba's value of the integral of the CIE 1931 luminance function [nm]
_FINE = 10  # steps of the integration between two nodes


class RgbSpectrum:
    """Spectrum of any linear Rec.709 colour: R b₀(λ) + G b₁(λ) + B b₂(λ), which a film turns into that colour again.

    The bᵢ are the smoothest functions for which that holds: piecewise linear at 5 nm, of least squared second
    difference. Smooth spectra are the least noisy at the few wavelengths of a path. Those of saturated colours are
    negative at some wavelengths. Make it in a spectral variant.

    Examples
    --------
    >>> RgbSpectrum().at(mi.Color3f(1, 0.5, 0.2), ray.wavelengths)     # doctest: +SKIP
    """

    def __init__(self) -> None:
        self._basis = to_device(mi.Float, smoothest_basis().astype(np.float32).ravel())

    def at(self, colour: mi.Color3f, wavelengths: mi.Color4f) -> mi.Color4f:
        """Spectral radiance of colours at wavelengths [nm], one path a lane."""
        x = dr.clip((wavelengths - _NODES[0]) / (_NODES[1] - _NODES[0]), 0, len(_NODES) - 1 - 1e-4)
        values = type(wavelengths)(0)
        for lane in range(len(wavelengths)):
            node = mi.UInt32(x[lane])
            weight = x[lane] - mi.Float(node)
            low, high = (dr.gather(mi.Color3f, self._basis, node + k) for k in (0, 1))
            values[lane] = dr.dot(dr.lerp(low, high, weight), colour)
        inside = (wavelengths >= _NODES[0]) & (wavelengths <= _NODES[-1])
        return dr.select(inside, values, 0)


def smoothest_basis() -> NDArray[np.float64]:
    """Values of the three bᵢ at the nodes, shape (95, 3)."""
    # ---- Colour of the hat function at each node: what Mitsuba's film makes of it ----
    fine = np.linspace(_NODES[0], _NODES[-1], (len(_NODES) - 1) * _FINE + 1)
    step = fine[1] - fine[0]
    matching = np.array(mi.xyz_to_srgb(mi.cie1931_xyz(mi.Float(fine)))).reshape(3, -1) / _LUMINANCE_OF_ONE
    hats = np.maximum(0.0, 1.0 - np.abs(fine - _NODES[:, None]) / (_NODES[1] - _NODES[0]))
    weights = np.full(len(fine), step)
    weights[[0, -1]] /= 2
    colours = hats @ (matching * weights).T
    # ---- Least |D b|² subject to colours of unit vectors: a linear system with Lagrange multipliers ----
    second = np.diff(np.eye(len(_NODES)), 2, axis=0)
    system = np.block([[second.T @ second, colours], [colours.T, np.zeros((3, 3))]])
    wanted = np.concatenate([np.zeros((len(_NODES), 3)), np.eye(3)])
    return np.asarray(np.linalg.solve(system, wanted)[: len(_NODES)])
