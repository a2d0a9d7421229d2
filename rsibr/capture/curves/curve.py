"""Response curve of a camera, and the registry of curves that have a name.

A curve takes encoded values in [0, 1] to exposure relative to saturation, by channel. Every module of this package may
register one; no list of them stands elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError, did_you_mean
from rsibr.registered import import_all

KNOTS = 4096
"""Knots of a curve: the interpolation between them errs less than a step of 16 bits."""

_LEAST_SLOPE = 1e-6


@dataclass(frozen=True, eq=False)
class Curve:
    """Response curve, by channel.

    Attributes
    ----------
    name : str
        For messages.
    knots : ndarray, shape (3, K)
        Relative exposure at K encoded values spread evenly over [0, 1]; increases strictly from about 0 to 1.

    Examples
    --------
    >>> curve_named("srgb").linear([[0.5, 0.5, 0.5]]).round(4).tolist()
    [[0.214, 0.214, 0.214]]
    """

    name: str
    knots: NDArray[np.float64]
    _at: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.knots.ndim != 2 or self.knots.shape[0] != 3 or self.knots.shape[1] < 2:
            raise ValueError(f"knots of shape {self.knots.shape}, not (3, K)")
        if not np.isfinite(self.knots).all() or (np.diff(self.knots, axis=1) <= 0).any():
            raise InputError("is no curve that increases everywhere", where=self.name, fix="give a monotone curve")
        object.__setattr__(self, "_at", np.linspace(0.0, 1.0, self.knots.shape[1]))

    @classmethod
    def of(cls, name: str, formula: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Curve:
        """Curve that is the same for all channels, from the formula of its exposure."""
        return cls(name, np.tile(formula(np.linspace(0.0, 1.0, KNOTS)), (3, 1)))

    def linear(self, values: ArrayLike) -> NDArray[np.float64]:
        """Relative exposure of encoded values, shape (..., 3); 1 is saturation."""
        return self._by_channel(values, lambda one, k: np.interp(one, self._at, self.knots[k]))

    def encoded(self, exposure: ArrayLike) -> NDArray[np.float64]:
        """Encoded values of relative exposures, shape (..., 3); clipped to [0, 1]."""
        return self._by_channel(exposure, lambda one, k: np.interp(one, self.knots[k], self._at))

    def slope(self, values: ArrayLike) -> NDArray[np.float64]:
        """Change of relative exposure with the encoded value, shape (..., 3); positive."""
        step = self._at[1]
        slopes = np.maximum(np.gradient(self.knots, step, axis=1), _LEAST_SLOPE)
        return self._by_channel(values, lambda one, k: np.interp(one, self._at, slopes[k]))

    @staticmethod
    def _by_channel(
        values: ArrayLike, of: Callable[[NDArray[np.float64], int], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        array = np.asarray(values, dtype=np.float64)
        return np.stack([of(array[..., k], k) for k in range(3)], axis=-1)


_curves: dict[str, Curve] = {}


def register(curve: Curve) -> Curve:
    """Register a curve by its name."""
    _curves[curve.name] = curve
    return curve


def curve_names() -> list[str]:
    """Names of the registered curves."""
    import_all("rsibr.capture.curves")
    return sorted(_curves)


def curve_named(name: str) -> Curve:
    """Registered curve.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    known = curve_names()
    if name not in known:
        fix = f"{did_you_mean(name, known)}use one of: {', '.join(known)}, or a file"
        raise InputError(f"unknown curve '{name}'", where="curve", fix=fix)
    return _curves[name]
