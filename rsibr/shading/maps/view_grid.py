"""Grid of views over the directions in which a camera sees a scene."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.bilinear import BilinearCell
from rsibr.geometry.to_device import to_device
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.scenes.object_scene import ObjectScene

SPACING_DEG = 10.0
"""Angle between neighbouring views at most, unless that takes more than `MOST` of them a side: 5 for 40°."""

FEWEST, MOST = 2, 9
_LEAST_DEPTH = 1e-3  # of corners of the bounding box before the camera, in units of the scene's radius


@dataclass(eq=False)
class ViewGrid:
    """Views to even places of the image plane, row by row from the top left.

    Attributes
    ----------
    frames : list of ndarray, shape (3, 3)
        Frame of each view: columns x, y, z in world coordinates, z toward the camera, transported from the camera's
        axes by the smallest rotation.
    packed : mi.Float
        Camera's axes right, up, backward; left and top edge of the grid in the plane at unit depth, and steps per unit
        of it to the right and downward.
    columns, rows : mi.UInt32
        Views a row and a column.
    """

    frames: list[NDArray[np.float64]]
    packed: mi.Float
    columns: mi.UInt32
    rows: mi.UInt32

    @classmethod
    def over(cls, camera: Camera, scene: ObjectScene, side: int | None = None) -> ViewGrid:
        """Lay a grid over the part of a picture in which the scene lies.

        Parameters
        ----------
        camera : Camera
            Camera.
        scene : ObjectScene
            Scene; its bounding box narrows the grid.
        side : int, optional
            Views a side; by default as many as `SPACING_DEG` demands.
        """
        low, high = seen_window(camera, scene)
        angles = np.degrees(np.arctan(high) - np.arctan(low))
        wanted = np.full(2, side) if side else np.clip(np.ceil(angles / SPACING_DEG - 1e-6) + 1, FEWEST, MOST)
        columns, rows = (int(n) for n in wanted)
        places = product(np.linspace(high[1], low[1], rows), np.linspace(low[0], high[0], columns))
        frames = [_frame(camera, x, y) for y, x in places]
        steps = (np.array([columns, rows]) - 1) / np.maximum(high - low, 1e-12)
        numbers = np.concatenate([camera.axes.T.ravel(), [low[0], high[1]], steps]).astype(np.float32)
        return cls(frames, to_device(mi.Float, numbers), dr.opaque(mi.UInt32, columns), dr.opaque(mi.UInt32, rows))

    def around(self, v: mi.Vector3f) -> list[tuple[mi.UInt32, mi.Float]]:
        """Four views around directions to the viewer, with their weights.

        Parameters
        ----------
        v : mi.Vector3f
            Unit directions to the viewer; those beyond the grid are moved to its edge.
        """
        right, up, backward = (dr.gather(mi.Vector3f, self.packed, mi.UInt32(k)) for k in range(3))
        left, top, across, down = (dr.gather(mi.Float, self.packed, mi.UInt32(k)) for k in range(9, 13))
        depth = dr.rcp(dr.maximum(dr.dot(v, backward), 1e-6))
        x, y = -dr.dot(v, right) * depth, -dr.dot(v, up) * depth
        cell = BilinearCell.at(
            dr.clip((x - left) * across, 0, mi.Float(self.columns - 1) * (1 - 1e-6)),
            dr.clip((top - y) * down, 0, mi.Float(self.rows - 1) * (1 - 1e-6)),
        )
        first = cell.corner(self.columns)
        sides = [(1 - cell.rightward, 0), (cell.rightward, 1)]
        return [
            (first + m * self.columns + k, share * part)
            for part, m in [(1 - cell.downward, 0), (cell.downward, 1)]
            for share, k in sides
        ]


def seen_window(camera: Camera, scene: ObjectScene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest place in the plane at unit depth (right, up) that a picture shows of a scene."""
    left, top, wide, tall = camera.window
    aspect = (camera.height / tall) / (camera.width / wide)
    half = camera.half_width * np.array([1.0, aspect])
    low = half * np.array([2 * left - 1, 1 - 2 * (top + tall)])
    high = half * np.array([2 * (left + wide) - 1, 1 - 2 * top])
    # ---- Narrow it to the bounding box, if all of it lies before the camera ----
    corners = np.stack([scene.bounds[list(pick), range(3)] for pick in product((0, 1), repeat=3)])
    local = (corners - camera.position) @ camera.axes
    if (-local[:, 2] > _LEAST_DEPTH * scene.radius).all():
        places = local[:, :2] / -local[:, 2:]
        inner = np.clip(np.stack([places.min(axis=0), places.max(axis=0)]), low, high)
        if (inner[1] > inner[0]).all():
            return inner[0], inner[1]
    return low, high


def _frame(camera: Camera, x: float, y: float) -> NDArray[np.float64]:
    """Frame of the view from a place of the plane at unit depth."""
    view = np.array([-x, -y, 1.0]) / np.sqrt(x * x + y * y + 1)  # in the camera's axes, toward the camera
    # Minimal rotation from z to the view; Rodrigues' formula with the axis z × view
    a, b, c = view
    turned = np.array(
        [[1 - a * a / (1 + c), -a * b / (1 + c), a], [-a * b / (1 + c), 1 - b * b / (1 + c), b], [-a, -b, c]]
    )
    return np.asarray(camera.axes @ turned)
