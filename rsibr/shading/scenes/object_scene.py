"""Shapes of a scene by id, and the camera that came with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.shading.cameras.camera import Camera

_LIFT = 1e-4  # of the scene's radius
_LIFT_STEPS = 8  # of the largest coordinate in float32: hit points are off by a few


@dataclass(eq=False)
class ObjectScene:
    """Shapes to shade.

    Attributes
    ----------
    name : str
        Name for messages and reports: the file's.
    shapes : dict of str to mi.Shape
        Shapes by their ids, with the BSDFs of the file.
    camera : Camera or None
        Camera of the file; None if it has none.
    notes : tuple of str
        What of the file is not used, in a sentence each.
    """

    name: str
    shapes: dict[str, Any]
    camera: Camera | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.shapes:
            raise InputError("no shape to shade", where=self.name, fix="give a scene or a mesh with surfaces")

    @cached_property
    def geometry(self) -> mi.Scene:
        """Mitsuba scene of the shapes alone."""
        return self.loaded({})

    def loaded(self, extra: Mapping[str, Any]) -> mi.Scene:
        """Mitsuba scene of the shapes and further entries of its dictionary, such as an emitter.

        The shapes have keys of their own in it: ids may hold dots, which keys may not, or be those of `extra`.
        """
        keyed = {f"rsibr_shape_{number}": shape for number, shape in enumerate(self.shapes.values())}
        scene = backend.load({"type": "scene", **keyed, **extra})
        for name, shape in self.shapes.items():
            shape.set_id(name)  # Mitsuba has made the key the id
        return scene

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Corners of the bounding box, shape (2, 3): least and greatest coordinates."""
        box = self.geometry.bbox()
        return np.array([box.min, box.max], dtype=np.float64).reshape(2, 3)

    @property
    def centre(self) -> NDArray[np.float64]:
        """Middle of the bounding box, shape (3,)."""
        return np.asarray(self.bounds.mean(axis=0))

    @property
    def radius(self) -> float:
        """Radius of the bounding box's circumscribed sphere."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]) / 2)

    @property
    def lift(self) -> float:
        """Distance above a surface at which rays from it start: more than it is off, far from the origin too."""
        return max(_LIFT * self.radius, _LIFT_STEPS * float(np.spacing(np.abs(self.bounds).max().astype(np.float32))))
