"""Cone of the rays that touch a sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame

_LEAST_POINTS = 8


@dataclass(frozen=True, eq=False)
class Cone:
    """Cone of tangents to a sphere, from the camera.

    Attributes
    ----------
    axis : ndarray, shape (3,)
        Unit direction from the camera to the centre of the sphere, in world coordinates.
    distance : float
        From the camera to the centre, in radii of the sphere; above 1.
    residual : float
        Root mean square distance of the points from the fitted rim, as an angle [rad].
    """

    axis: NDArray[np.float64]
    distance: float
    residual: float

    @property
    def half_angle(self) -> float:
        """Angle between the axis and the rim [rad]."""
        return float(np.arcsin(1 / self.distance))

    def rim(self, camera: Pinhole, count: int = 256) -> NDArray[np.float64]:
        """Places of the rim in the picture [pixels], shape (count, 2)."""
        side, other, _ = view_frame(self.axis).T
        turn = np.linspace(0, 2 * np.pi, count, endpoint=False)[:, None]
        around = np.cos(turn) * side + np.sin(turn) * other
        rays = np.cos(self.half_angle) * self.axis + np.sin(self.half_angle) * around
        return camera.project(camera.position + rays)


def fitted_cone(camera: Pinhole, places: ArrayLike) -> Cone:
    """Fit the cone to places of the rim.

    Parameters
    ----------
    camera : Pinhole
        Camera of the photograph; its pose decides the frame of the axis.
    places : array_like, shape (n, 2)
        Places on the rim [pixels], at least 8.

    Raises
    ------
    InputError
        If there are too few, or they lie on no cone about a direction in front of the camera.

    Notes
    -----
    Each unit ray d of the rim has d·m = 1 for one vector m, which is linear in m: the axis is m/|m|, and the distance
    |m|/√(|m|² − 1).

    Examples
    --------
    >>> camera = Pinhole.looking((0, 0, 5), (0, 0, 0), fov_deg=40, width=320, height=320)
    >>> rim = Cone(np.array([0.0, 0.0, -1.0]), 5.0, 0.0).rim(camera)
    >>> round(fitted_cone(camera, rim).distance, 9)
    5.0
    """
    points = np.asarray(places, dtype=np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < _LEAST_POINTS or not np.isfinite(points).all():
        what = f"{len(points)} places of a silhouette"
        raise InputError(what, where="silhouette", fix=f"give {_LEAST_POINTS} or more, as x and y in pixels")
    rays = camera.directions(points)
    normal, _, rank, _ = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)
    size = float(np.linalg.norm(normal))
    if rank < 3 or size <= 1 + 1e-12:
        raise InputError("these places lie on no outline of a sphere", where="silhouette", fix="mark its rim anew")
    axis: NDArray[np.float64] = np.asarray(normal / size, dtype=np.float64)
    distance = size / float(np.sqrt(size**2 - 1))
    off = np.arccos(np.clip(rays @ axis, -1, 1)) - np.arcsin(1 / distance)
    return Cone(axis, distance, float(np.sqrt(np.mean(off**2))))
