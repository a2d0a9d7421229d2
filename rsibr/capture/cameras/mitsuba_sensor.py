"""Mitsuba's sensor of a pinhole camera."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.errors import InputError

_SQUARE = 1e-9


def sensor_of(camera: Pinhole, samples: int) -> dict[str, Any]:
    """Sensor as plain data; a pixel is the mean over its area.

    Raises
    ------
    InputError
        If the pixels are not square: Mitsuba has no others.
    """
    fx, fy = camera.focal
    if abs(fx / fy - 1) > _SQUARE:
        raise InputError("pixels that are not square", where="camera", fix="give equal focal lengths")
    right, down, forward = camera.axes.T
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([-right, -down, forward, camera.position])  # Mitsuba's columns: left, up, forward
    shift = 0.5 - camera.principal / (camera.width, camera.height)
    return {
        "type": "perspective",
        "to_world": mi.ScalarAffineTransform4f(matrix.astype(np.float32)),
        "fov": float(np.degrees(2 * np.arctan(camera.width / (2 * fx)))),
        "fov_axis": "x",
        "principal_point_offset_x": float(shift[0]),
        "principal_point_offset_y": float(shift[1]),
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "pixel_format": "rgba",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "multijitter", "sample_count": samples},
    }
