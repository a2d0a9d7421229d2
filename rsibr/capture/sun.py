"""`rsibr capture sun`: the energy of a saturated source, from a photograph of a matte ball."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr import backend
from rsibr.capture.ball import BallShot
from rsibr.capture.balls.sun import Sun, sun_of, with_sun
from rsibr.capture.curves.curve import Curve
from rsibr.capture.exr_parts import read_parts, write_parts
from rsibr.errors import InputError

_RADIANCE, _SATURATED = "radiance", "saturated"


@dataclass(frozen=True, eq=False)
class SunnyEnvironment:
    """Result of `capture_sun`.

    Attributes
    ----------
    radiance : ndarray, shape (H, W, 3), float32
        Latitude–longitude map that holds the source with its energy.
    sun : Sun
        Direction and irradiance of the source.
    """

    radiance: NDArray[np.float32]
    sun: Sun

    def write(self, path: Path | str) -> None:
        """Write the map as OpenEXR, atomically."""
        write_parts(path, {_RADIANCE: self.radiance})


@backend.in_session
def capture_sun(
    environment: Path | str,
    shot: BallShot,
    *,
    reflectance: float | None = None,
    up: ArrayLike = (0.0, 1.0, 0.0),
    curve: str | Path | Curve = "srgb",
) -> SunnyEnvironment:
    """Find the energy of the saturated source of an environment.

    Parameters
    ----------
    environment : path
        Result of `capture ball`, in which the source is marked as saturated.
    shot : BallShot
        Matte ball that the source lights, in the same units of radiance.
    reflectance : float, optional
        Of the matte ball, above 0 and up to 1; by default found in the photograph.
    up : array_like, shape (3,)
        World direction that is upward; the camera was held level.
    curve : str, path or Curve
        Of a photograph that is not linear.

    Raises
    ------
    InputError
        If the environment marks nothing as saturated, or the photograph cannot be used.
    """
    if reflectance is not None and not 0 < reflectance <= 1:
        raise InputError(f"a reflectance of {reflectance:g}", where="reflectance", fix="give 0 to 1, or leave it out")
    parts = read_parts(Path(environment))
    if not {_RADIANCE, _SATURATED} <= set(parts):
        what = f"has no parts {_RADIANCE} and {_SATURATED}"
        raise InputError(what, where=str(environment), fix="give a result of `rsibr capture ball`")
    saturated: NDArray[np.bool_] = np.asarray(np.atleast_3d(parts[_SATURATED] > 0.5).max(axis=2))
    sun = sun_of(parts[_RADIANCE], saturated, shot.placed(up, curve), reflectance)
    return SunnyEnvironment(with_sun(parts[_RADIANCE], saturated, sun), sun)
