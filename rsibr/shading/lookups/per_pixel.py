"""A view of its own for each surface: `Method.eval` of its normal and the direction to the camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import mitsuba as mi

from rsibr.methods.protocol import Method
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.lookups.registry import Shade, register_lookup
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import Surfaces


@register_lookup("pixel", summary="each pixel from its own view")
@dataclass(eq=False)
class PerPixel:
    """Lookup of each surface by its own normal and view.

    Attributes
    ----------
    method : Method
        Method of the bake.
    scene : ObjectScene
        Not used.
    """

    method: Method
    scene: ObjectScene
    needs_footprint: ClassVar[bool] = False

    def toward(self, camera: Camera) -> Shade:  # noqa: ARG002
        """See `Lookup`."""
        some = mi.Vector3f(0, 0, 1)
        self.method.eval(some, some)  # what a method makes at its first use, it must not make while a loop is traced

        def shade(surfaces: Surfaces) -> mi.Color3f:
            return self.method.eval(surfaces.n, surfaces.v)

        return shade
