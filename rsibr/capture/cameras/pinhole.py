"""Pinhole camera of a photograph: intrinsics in pixels and a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera

_ORTHONORMAL = 1e-3


@dataclass(frozen=True, eq=False)
class Pinhole:
    """Pinhole camera without distortion.

    Places of a picture are in pixels from its top left corner; the middle of the first pixel is (0.5, 0.5).

    Attributes
    ----------
    width, height : int
        Pixels.
    focal : ndarray, shape (2,)
        fx, fy [pixels].
    principal : ndarray, shape (2,)
        cx, cy [pixels].
    position : ndarray, shape (3,)
        Centre of projection in world coordinates.
    axes : ndarray, shape (3, 3)
        Columns right, down, forward in world coordinates (OpenCV's), orthonormal.

    Examples
    --------
    >>> camera = Pinhole.looking((0, 0, 5), (0, 0, 0), fov_deg=40, width=320, height=240)
    >>> camera.project([[0, 0, 0]]).tolist()
    [[160.0, 120.0]]
    """

    width: int
    height: int
    focal: NDArray[np.float64]
    principal: NDArray[np.float64]
    position: NDArray[np.float64]
    axes: NDArray[np.float64]

    def __post_init__(self) -> None:
        if not (self.focal > 0).all() or not np.isfinite(self.principal).all():
            raise InputError(f"focal lengths of {self.focal} pixels", where="intrinsics", fix="give positive numbers")
        if not np.isfinite(self.position).all() or not np.isfinite(self.axes).all():
            raise InputError("the pose is not finite", where="pose", fix="give finite numbers")
        off = np.abs(self.axes.T @ self.axes - np.eye(3)).max()
        if off > _ORTHONORMAL or np.linalg.det(self.axes) < 0:
            what = f"the rotation is no rotation (its columns are off by {off:.2g}, or mirrored)"
            raise InputError(what, where="pose", fix="give a rotation without scale, and name its convention")

    @classmethod
    def looking(
        cls,
        position: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0.0, 1.0, 0.0),
        *,
        fov_deg: float,
        width: int,
        height: int,
    ) -> Pinhole:
        """Make a camera that looks at a point, with square pixels.

        Parameters
        ----------
        position, target, up : array_like, shape (3,)
            World coordinates; an `up` along the view direction is replaced by another.
        fov_deg : float
            Horizontal field of view [degrees].
        width, height : int
            Pixels.

        Raises
        ------
        InputError
            If the position is the target, or the field of view is out of range.
        """
        camera = Camera.look_at(position, target, up, fov_deg=fov_deg, width=width, height=height)
        focal = np.full(2, width / (2 * camera.half_width))
        axes = camera.axes * np.array([1.0, -1.0, -1.0])  # its columns: right, up, backward
        return cls(width, height, focal, np.array([width, height]) / 2, camera.position, axes)

    def directions(self, places: ArrayLike) -> NDArray[np.float64]:
        """Unit world directions of the rays through places of the picture, shape (..., 2) to (..., 3)."""
        flat = (np.asarray(places, dtype=np.float64) - self.principal) / self.focal
        rays = np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1) @ self.axes.T
        return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Places of world points in the picture, shape (..., 3) to (..., 2); NaN behind the camera."""
        local = (np.asarray(points, dtype=np.float64) - self.position) @ self.axes
        depth = np.where(local[..., 2:] > 0, local[..., 2:], np.nan)
        return np.asarray(local[..., :2] / depth * self.focal + self.principal)
