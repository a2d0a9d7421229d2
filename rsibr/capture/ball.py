"""`rsibr capture ball`: photographs of a mirror ball become an environment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.capture.balls.ball_photograph import FARTHEST, BallPhotograph, placed
from rsibr.capture.balls.environment import BallEnvironment, environment_of
from rsibr.capture.balls.reflectance import reflectance_of
from rsibr.capture.brackets.hdr_image import HdrImage
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.curves.curve import Curve
from rsibr.capture.linear_image import linear_image
from rsibr.capture.silhouette.cone import Cone, fitted_cone
from rsibr.capture.silhouette.found import found_cone
from rsibr.capture.silhouette.marks import circle_places, mask_places
from rsibr.errors import InputError

_LEAST_HEIGHT, _MOST_HEIGHT = 4, 8192


@dataclass(frozen=True)
class BallShot:
    """Photograph of a ball, and what is known of it.

    Attributes
    ----------
    file : path
        Result of `capture hdr`, a linear file, or a single photograph.
    view : tuple of 3 floats
        World direction from the ball to the camera.
    fov_deg : float, optional
        Horizontal field of view [degrees].
    distance : float, optional
        From the camera to the centre of the ball, in its radii. One of the two must be given, not both.
    circle : tuple of 3 floats, optional
        Middle and radius of the ball's outline [pixels].
    mask : path, optional
        Picture that is white on the ball, in place of a circle. By default the outline is sought in the photograph.
    """

    file: Path | str
    view: tuple[float, float, float]
    fov_deg: float | None = None
    distance: float | None = None
    circle: tuple[float, float, float] | None = None
    mask: Path | str | None = None

    def placed(self, up: ArrayLike = (0.0, 1.0, 0.0), curve: str | Path | Curve = "srgb") -> BallPhotograph:
        """Read the photograph, and find its camera.

        Raises
        ------
        InputError
            If the file cannot be read, the outline is not found, or too little is known of the camera.
        """
        self._check()
        image = linear_image(self.file, curve)
        camera = self._camera(image)
        cone = self._cone(camera, image)
        return placed(image, camera, cone, self.view, up, str(self.file))

    def _check(self) -> None:
        """Raise an InputError where two options say the same thing, perhaps differently."""
        both = ""
        if self.fov_deg is not None and self.distance is not None:
            both = "the field of view and the distance"
        elif self.circle is not None and self.mask is not None:
            both = "a circle and a mask"
        if both:
            raise InputError(f"{both} are both given", where=str(self.file), fix="give one of them")

    def _camera(self, image: HdrImage) -> Pinhole:
        width, height = image.size
        if self.fov_deg is not None:
            if not 0 < self.fov_deg < 170:
                raise InputError(f"a field of view of {self.fov_deg:g}°", where="fov", fix="give 0 to 170 degrees")
            return _unplaced(width, height, width / (2 * np.tan(np.radians(self.fov_deg) / 2)))
        if self.distance is None:
            what = "neither the field of view nor the distance is known"
            raise InputError(
                what, where=str(self.file), fix="give --fov in degrees, or --distance in radii of the ball"
            )
        if not 1 < self.distance <= FARTHEST:
            fix = f"give more than 1, up to {FARTHEST:g}"
            raise InputError(f"a distance of {self.distance:g} radii", where="distance", fix=fix)
        far = _unplaced(width, height, 1e4 * width)  # rays are parallel: an outline is a circle
        outline = self._cone(far, image).rim(far)
        radius = float(np.hypot(*(outline - outline.mean(axis=0)).T).mean())
        return _unplaced(width, height, radius * float(np.sqrt(self.distance**2 - 1)))

    def _cone(self, camera: Pinhole, image: HdrImage) -> Cone:
        if self.circle is not None:
            return fitted_cone(camera, circle_places(*self.circle))
        if self.mask is None:
            return found_cone(camera, image.radiance, str(self.file))
        mask = linear_image(self.mask, "linear").radiance.mean(axis=2)
        if mask.shape != image.radiance.shape[:2]:
            raise InputError("has another size than its photograph", where=str(self.mask), fix="paint it anew")
        return fitted_cone(camera, mask_places(mask, str(self.mask)))


def capture_ball(
    shots: Sequence[BallShot],
    *,
    reflectance: str | float = "Ag",
    height: int = 256,
    up: ArrayLike = (0.0, 1.0, 0.0),
    photographer_deg: float = 5.0,
    curve: str | Path | Curve = "srgb",
) -> BallEnvironment:
    """Make an environment of photographs of a mirror ball.

    Parameters
    ----------
    shots : sequence of BallShot
        One, or better two at 90°.
    reflectance : str or float
        Of the ball: a metal that Mitsuba knows, or a number.
    height : int
        Rows of the map, 4 to 8192; twice as many columns.
    up : array_like, shape (3,)
        World direction that is upward; the cameras were held level.
    photographer_deg : float
        Half angle about the camera's own reflection that is left out [degrees].
    curve : str, path or Curve
        Of photographs that are not linear.

    Returns
    -------
    BallEnvironment

    Raises
    ------
    InputError
        If a photograph cannot be used, or an option is out of range.
    """
    if not shots:
        raise InputError("no photographs", where="shots", fix="name at least one")
    if not _LEAST_HEIGHT <= height <= _MOST_HEIGHT:
        fix = f"give {_LEAST_HEIGHT} to {_MOST_HEIGHT}"
        raise InputError(f"{height} rows", where="height", fix=fix)
    if not 0 <= photographer_deg < 90:
        raise InputError(f"{photographer_deg:g}°", where="photographer", fix="give 0 up to 90 degrees")
    mirror = reflectance_of(reflectance)
    return environment_of([shot.placed(up, curve) for shot in shots], mirror, height, photographer_deg=photographer_deg)


def _unplaced(width: int, height: int, focal: float) -> Pinhole:
    middle: NDArray[np.float64] = np.array([width, height]) / 2
    return Pinhole(width, height, np.full(2, focal), middle, np.zeros(3), np.eye(3))
