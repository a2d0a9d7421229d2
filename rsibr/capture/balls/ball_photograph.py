"""Photograph of a ball, with the camera's place in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from rsibr.capture.brackets.hdr_image import HdrImage
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.direction import unit
from rsibr.capture.silhouette.cone import Cone
from rsibr.errors import InputError

_NOT_PARALLEL = 1e-6

FARTHEST = 1e4
"""Largest distance of a camera in radii of the ball; beyond, float32 does not tell its rays apart."""


@dataclass(frozen=True, eq=False)
class BallPhotograph:
    """Radiance of a ball of radius 1 about the origin, as a camera saw it.

    Attributes
    ----------
    image : HdrImage
        Radiance and saturation.
    camera : Pinhole
        In world coordinates, in which the ball has its centre at the origin and the radius 1.
    name : str
        File that messages name.
    """

    image: HdrImage
    camera: Pinhole
    name: str

    @property
    def distance(self) -> float:
        """From the camera to the centre of the ball, in its radii."""
        return float(np.linalg.norm(self.camera.position))

    @property
    def view(self) -> NDArray[np.float64]:
        """Unit direction from the ball to the camera."""
        return np.asarray(self.camera.position / self.distance)

    @property
    def radius_pixels(self) -> float:
        """Mean radius of the outline [pixels]."""
        rim = Cone(-self.view, self.distance, 0.0).rim(self.camera)
        return float(np.hypot(*(rim - rim.mean(axis=0)).T).mean())


def placed(image: HdrImage, camera: Pinhole, cone: Cone, view: ArrayLike, up: ArrayLike, name: str) -> BallPhotograph:
    """Photograph whose camera is placed by its outline of the ball and the direction that the user names.

    Parameters
    ----------
    image : HdrImage
        Radiance.
    camera : Pinhole
        Intrinsics; its pose is the frame of `cone`.
    cone : Cone
        Outline of the ball.
    view : array_like, shape (3,)
        World direction from the ball to the camera.
    up : array_like, shape (3,)
        World direction that is upward; the camera was held level: its rows are at right angles to it.
    name : str
        File that messages name.

    Raises
    ------
    InputError
        If the view is no direction, or upward.
    """
    axis = cone.axis @ camera.axes  # of the ball, in the camera's own frame
    direction = unit(view, "view")
    position = direction * cone.distance
    axes = _levelled(axis, -direction, unit(up, "up"))
    intrinsics = (camera.width, camera.height, camera.focal, camera.principal)
    return BallPhotograph(image, Pinhole(*intrinsics, position, axes), name)


def _levelled(own: NDArray[np.float64], world: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Axes of the camera that sees the world's direction where its own is, with its rows level."""
    axes = _frame(world, up) @ _frame(own, np.array([0.0, -1.0, 0.0])).T  # the top of a picture is at −y
    row = axes[:, 0]
    along, across = (row @ world) * world, np.cross(world, row)
    # The turn t about the axis for which (along + cos t (row − along) + sin t across)·up = 0, nearest to 0
    fixed, cosine, sine = along @ up, (row - along) @ up, across @ up
    size = float(np.hypot(cosine, sine))
    if size < _NOT_PARALLEL or abs(fixed) > size:
        return np.asarray(axes)
    turns = np.arctan2(sine, cosine) + np.array([1, -1]) * np.arccos(-fixed / size)
    turn = min((turns + np.pi) % (2 * np.pi) - np.pi, key=abs)
    return np.asarray(Rotation.from_rotvec(turn * world).as_matrix() @ axes)


def _frame(forward: NDArray[np.float64], up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns right, down, forward."""
    right = np.cross(forward, up)
    if np.linalg.norm(right) < _NOT_PARALLEL:
        raise InputError("the view is along the upward direction", where="up", fix="give another --up")
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward], axis=1)
