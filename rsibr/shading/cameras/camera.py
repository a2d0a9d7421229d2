"""Perspective pinhole camera, and its rays on the device."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr.errors import InputError
from rsibr.geometry.to_device import to_device

_LEAST_FOV_DEG, _MOST_FOV_DEG = 0.01, 179.0


@dataclass(frozen=True, eq=False)
class Camera:
    """Perspective pinhole camera.

    Attributes
    ----------
    position : ndarray, shape (3,)
        In world coordinates.
    axes : ndarray, shape (3, 3)
        Columns right, up, and backward (opposite to the view direction), orthonormal.
    fov_deg : float
        Horizontal field of view [degrees].
    width, height : int
        Pixels of the picture.
    window : ndarray, shape (4,)
        Part of the field of view that the picture shows: left, top, width, height in units of the whole, with (0, 0) at
        the top left. Crop windows and principal points lie in it.

    Examples
    --------
    >>> camera = Camera.look_at((0, 0, 5), (0, 0, 0), fov_deg=40, width=320, height=240)
    >>> camera.forward.tolist()
    [0.0, 0.0, -1.0]
    """

    position: NDArray[np.float64]
    axes: NDArray[np.float64]
    fov_deg: float
    width: int
    height: int
    window: NDArray[np.float64]

    @classmethod
    def look_at(
        cls,
        position: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0.0, 1.0, 0.0),
        *,
        fov_deg: float = 40.0,
        width: int = 512,
        height: int = 512,
    ) -> Camera:
        """Make a camera that looks at a point.

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
        if not _LEAST_FOV_DEG <= fov_deg <= _MOST_FOV_DEG:
            fix = f"give {_LEAST_FOV_DEG:g} to {_MOST_FOV_DEG:g} degrees"
            raise InputError(f"a field of view of {fov_deg:g}°", where="camera", fix=fix)
        eye, at = np.asarray(position, dtype=np.float64), np.asarray(target, dtype=np.float64)
        backward = eye - at
        distance = float(np.linalg.norm(backward))
        if not math.isfinite(distance) or distance == 0.0:
            raise InputError("it looks at its own position", where="camera", fix="move it away from its target")
        backward = backward / distance
        right = np.cross(np.asarray(up, dtype=np.float64), backward)
        if not np.linalg.norm(right) > 1e-6 * np.linalg.norm(up):
            right = np.cross([0.0, 0.0, -1.0] if abs(backward[2]) < 0.9 else [1.0, 0.0, 0.0], backward)
        right = right / np.linalg.norm(right)
        axes = np.stack([right, np.cross(backward, right), backward], axis=1)
        return cls(eye, axes, float(fov_deg), width, height, np.array([0.0, 0.0, 1.0, 1.0]))

    @classmethod
    def of_sensor(cls, sensor: mi.Sensor) -> Camera:
        """Make the camera of a perspective sensor of Mitsuba: same rays, same pixels.

        Principal point and crop window are kept; the lens of a `thinlens` is taken as a pinhole, and clipping planes
        are left out.

        Parameters
        ----------
        sensor : mi.Sensor
            Loaded in any variant.

        Raises
        ------
        InputError
            If it is no perspective sensor.
        """
        values = mi.traverse(sensor)
        if "x_fov" not in values:
            kind = sensor.class_name()
            raise InputError(f"a sensor of the class {kind}", where="camera", fix="use a perspective sensor")
        film = sensor.film()
        whole, crop, corner = (
            np.array(value, dtype=np.float64).reshape(2)
            for value in (film.size(), film.crop_size(), film.crop_offset())
        )
        shift = [_number(values[key]) if (key := f"principal_point_offset_{axis}") in values else 0.0 for axis in "xy"]
        window = np.concatenate([corner / whole + shift, crop / whole])
        to_world = np.array(sensor.world_transform().matrix, dtype=np.float64).reshape(4, 4)
        axes = to_world[:3, :3] * np.array([-1.0, 1.0, -1.0])  # Mitsuba's columns: left, up, forward
        axes /= np.linalg.norm(axes, axis=0)
        return cls(to_world[:3, 3], axes, _number(values["x_fov"]), int(crop[0]), int(crop[1]), window)

    @property
    def forward(self) -> NDArray[np.float64]:
        """Unit view direction in world coordinates."""
        return 0.0 - self.axes[:, 2]

    @property
    def half_width(self) -> float:
        """Tangent of half the horizontal field of view."""
        return math.tan(math.radians(self.fov_deg) / 2)

    def resized(self, width: int, height: int) -> Camera:
        """Return the camera with other pixels; the horizontal field of view stays."""
        return replace(self, width=width, height=height)

    def on_device(self) -> CameraRays:
        """Put the camera on the device; all cameras share their kernels."""
        # ---- Direction = corner + x·across + y·down, for a place (x, y) in pixels from the top left ----
        left, top, across, down = self.window
        aspect = (self.height / down) / (self.width / across)  # of the whole field of view
        right, up, backward = self.axes.T * np.array([[self.half_width], [self.half_width * aspect], [1.0]])
        corner = -backward - right + up + 2 * left * right - 2 * top * up
        columns = [self.position, corner, 2 * across / self.width * right, -2 * down / self.height * up]
        packed = to_device(mi.Float, np.concatenate(columns).astype(np.float32))
        return CameraRays(packed, dr.opaque(mi.UInt32, self.width), dr.opaque(mi.UInt32, self.height))


@dataclass
class CameraRays:
    """Camera as inputs of a kernel.

    Attributes
    ----------
    packed : mi.Float
        Position; direction of the top left corner; change of direction for a pixel to the right, and downward.
    width, height : mi.UInt32
        Pixels.
    """

    packed: mi.Float
    width: mi.UInt32
    height: mi.UInt32

    def ray(self, place: mi.Point2f) -> mi.Ray3f:
        """Primary ray through a place of the picture [pixels], (0, 0) being its top left corner."""
        position, corner, across, down = (
            mi.Vector3f(*(dr.gather(mi.Float, self.packed, 3 * row + axis) for axis in range(3))) for row in range(4)
        )
        return mi.Ray3f(mi.Point3f(position), dr.normalize(corner + place.x * across + place.y * down))

    def centre(self, pixel: mi.UInt32) -> mi.Point2f:
        """Middle of a pixel [pixels], row by row from the top."""
        return mi.Point2f(mi.Float(pixel % self.width) + 0.5, mi.Float(pixel // self.width) + 0.5)


def _number(value: object) -> float:
    return float(np.array(value, dtype=np.float64).reshape(-1)[0])
