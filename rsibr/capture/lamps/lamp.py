"""Lamps that a table of distant light can hold, and what each gives a surface at the object's place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.direction import unit
from rsibr.capture.lamps.hat import add_light
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame

NEAR = 30.0
"""Distance in radii of the object below which a table errs by more than 5 %.

Its irradiance on a sphere differs from the lamp's by 47, 15, 5 and 1.5 % (rms over rms) at 3, 10, 30 and 100 radii.
"""

_POINTS = 512  # of a disc
_GOLDEN = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True)
class Lamp:
    """Light in one direction.

    Attributes
    ----------
    direction : tuple of 3 floats
        Toward the lamp; need not be of unit length.
    irradiance : tuple of 3 floats
        R, G, B on a surface that faces it [W m⁻²].
    half_angle_deg : float
        Of a disc as seen from the object [degrees]; 0: a point.
    """

    direction: tuple[float, float, float]
    irradiance: tuple[float, float, float]
    half_angle_deg: float = 0.0

    def __post_init__(self) -> None:
        unit(self.direction, "direction")
        if not (np.isfinite(self.irradiance).all() and min(self.irradiance) >= 0):
            raise InputError(f"an irradiance of {self.irradiance}", where="irradiance", fix="give numbers of 0 or more")
        if not 0 <= self.half_angle_deg < 90:
            what = f"a disc of half angle {self.half_angle_deg:g}°"
            raise InputError(what, where="half_angle", fix="give 0 up to 90 degrees")

    @property
    def toward(self) -> NDArray[np.float64]:
        """Unit direction toward the lamp."""
        return unit(self.direction, "direction")

    def added_to(self, image: NDArray[np.floating]) -> NDArray[np.float32]:
        """Add the lamp to a latitude–longitude map, shape (H, W, 3)."""
        energy = np.asarray(self.irradiance, dtype=np.float64)
        if self.half_angle_deg == 0:
            return add_light(image, self.toward, energy)
        points, cosines = _disc(self.toward, math.radians(self.half_angle_deg))
        # The radiance is even, and gives the irradiance on a surface that faces the middle of the disc
        return add_light(image, points, np.tile(energy / cosines.sum(), (len(points), 1)))


def point_lamp(position: tuple[float, float, float], intensity: tuple[float, float, float]) -> Lamp:
    """Lamp at a place, as seen from the origin: E = I/r².

    Parameters
    ----------
    position : tuple of 3 floats
        Relative to the object's centre.
    intensity : tuple of 3 floats
        R, G, B [W sr⁻¹].

    Raises
    ------
    InputError
        If the lamp is at the origin.
    """
    x, y, z = position
    distance = math.hypot(x, y, z)
    if not (math.isfinite(distance) and distance > 0):
        what = f"a lamp at {x:g},{y:g},{z:g}, and the object's centre at the origin"
        raise InputError(what, where="position", fix="give a place at some distance")
    red, green, blue = (value / distance / distance for value in intensity)
    return Lamp(position, (red, green, blue))


def near_note(distance: float, radius: float) -> str | None:
    """Warning where a lamp is too near for a table of distant light; None where it is not.

    Parameters
    ----------
    distance : float
        From the object's centre.
    radius : float
        Of the object, in the same unit.
    """
    if distance >= NEAR * radius:
        return None
    return (
        f"a lamp {distance / radius:.3g} radii away: its light changes over the object, which a table of distant light "
        f"does not hold; below {NEAR:g} radii it errs by more than 5 %"
    )


def _disc(axis: NDArray[np.float64], half_angle: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions spread evenly over a cap, and their cosines to its axis (Fibonacci's spiral)."""
    index = np.arange(_POINTS) + 0.5
    cosine = 1 - index / _POINTS * (1 - math.cos(half_angle))
    sine, turn = np.sqrt(1 - cosine**2), index * _GOLDEN
    side, other, _ = view_frame(axis).T
    around = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    return cosine[:, None] * axis + sine[:, None] * around, cosine
