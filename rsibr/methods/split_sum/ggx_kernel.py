"""Kernel of the prefiltered environment of split-sum shading, and its splitting into a sum over length scales."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np


@dataclass(frozen=True)
class GGXKernel:
    """K(θ) = D(h) (n·h) / (4 v·h) (n·l) with n = v = r: what a sample of the GGX distribution weighs the light by.

    Attributes
    ----------
    alpha : float
        Roughness α > 0.

    Notes
    -----
    Karis (2013), eq. 4 and the code after it: half vectors drawn from D, weight n·l. With n = v = r the half vector is
    at θ/2 from r, so that K depends on the angle θ between r and l alone: with s = sin² θ/2 and b = 1 − α²,
    K = α² / (4π) (1 − 2s) (α² + b s)⁻² for s < 1/2, and zero below the horizon.
    """

    alpha: float

    def value(self, s: Any, xp: Any = np) -> Any:
        """K [sr⁻¹] by s = sin² θ/2."""
        square = self.alpha**2
        base = square + (1 - square) * s
        return square / (4 * np.pi) * xp.maximum(1 - 2 * s, 0) / (base * base)


@dataclass(frozen=True)
class SoftenedKernel:
    """α²-free part (α² + b s)⁻² of the kernel, continued inside a radius by its Taylor polynomial of degree 3 in s.

    The difference of two of them vanishes outside the larger radius and is positive: all derivatives alternate.

    Attributes
    ----------
    base : mi.Float
        α² + b s_R at the radius R (opaque).
    slope : mi.Float
        b (opaque).
    edge : mi.Float
        s_R = sin² R/2 (opaque); 0 leaves the kernel as it is.
    """

    base: mi.Float
    slope: mi.Float
    edge: mi.Float

    @classmethod
    def of(cls, kernel: GGXKernel, radius: float) -> SoftenedKernel:
        """Soften inside an angle [rad]."""
        slope, edge = 1 - kernel.alpha**2, np.sin(radius / 2) ** 2
        values = kernel.alpha**2 + slope * edge, slope, edge
        return cls(*(dr.opaque(mi.Float, value) for value in values))

    def at(self, s: mi.Float) -> mi.Float:
        """Value by s = sin² θ/2."""
        x, shrink = self._terms(s)
        return shrink * shrink * dr.fma(x, dr.fma(x, dr.fma(x, 4, 3), 2), 1)

    def mean_at(self, s: mi.Float, variance: mi.Float) -> mi.Float:
        """Mean of (1 − 2s) T(s) over a small source around s, to second order: f + ½ σ² ∇²f; 0 below the horizon.

        Parameters
        ----------
        s : mi.Float
            sin² θ/2 of the source's centroid.
        variance : mi.Float
            Variance σ² [rad²] of its light along one axis.

        Notes
        -----
        On the sphere ∇²f = s (1 − s) f'' + (1 − 2s) f' for a function of s alone.
        """
        # ---- T and its derivatives: a polynomial inside the edge, a power law outside ----
        x, shrink = self._terms(s)
        steep = self.slope * shrink
        square = shrink * shrink
        value = square * dr.fma(x, dr.fma(x, dr.fma(x, 4, 3), 2), 1)
        first = -square * steep * dr.fma(x, dr.fma(x, 12, 6), 2)
        second = square * steep * steep * dr.fma(x, 24, 6)
        # ---- Times the cosine of the light ----
        cosine = 1 - 2 * s
        slope = cosine * first - 2 * value
        bend = cosine * second - 4 * first
        mean = cosine * value + 0.5 * variance * (s * (1 - s) * bend + cosine * slope)
        return dr.select(cosine > 0, dr.maximum(mean, 0), 0)

    def _terms(self, s: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Return x with (1 − x)⁻² = Σ (k + 1) xᵏ, 0 outside the edge, and (α² + b s)⁻¹, inside as at the edge."""
        x = dr.select(s < self.edge, self.slope * (self.edge - s) / self.base, 0)
        return x, dr.rcp(dr.fma(self.slope, dr.maximum(s, self.edge), self.base - self.slope * self.edge))
