"""Exposure of a photograph: how much light it took."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rsibr.errors import InputError

_REFERENCE_ISO = 100.0
_LEAST_AMOUNT, _MOST_AMOUNT = 1e-12, 1e12  # no camera comes near; beyond, a merge leaves the range of float32


@dataclass(frozen=True)
class Exposure:
    """Settings of a camera that decide how much light a photograph took.

    Attributes
    ----------
    seconds : float
        Time that the shutter was open [s], positive.
    f_number : float
        Focal length over the diameter of the aperture.
    iso : float
        Sensitivity.

    Examples
    --------
    >>> Exposure(seconds=1 / 50, f_number=8.0).amount / Exposure(seconds=1 / 50, f_number=16.0).amount
    4.0
    """

    seconds: float
    f_number: float = 1.0
    iso: float = _REFERENCE_ISO

    def __post_init__(self) -> None:
        for name, value in (("seconds", self.seconds), ("f_number", self.f_number), ("iso", self.iso)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} is {value:g}", where="exposure", fix="give positive numbers")
        if not _LEAST_AMOUNT <= self.amount <= _MOST_AMOUNT:
            what = f"{self.seconds:g} s at f/{self.f_number:g} and ISO {self.iso:g}"
            raise InputError(what, where="exposure", fix="give what a camera can have, in seconds")

    @property
    def amount(self) -> float:
        """Stored linear value per radiance, up to a constant of the camera: t · (ISO/100) / N²."""
        return self.seconds * (self.iso / _REFERENCE_ISO) / self.f_number / self.f_number

    def to_record(self) -> dict[str, float]:
        """The settings as a table of JSON."""
        return {"seconds": self.seconds, "f_number": self.f_number, "iso": self.iso}
