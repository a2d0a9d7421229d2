"""Which shape of a scene is shaded from which bake."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np

from rsibr.errors import InputError, did_you_mean
from rsibr.geometry.to_device import to_device
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surfaces import Surfaces

_STRUCTURES = {"Mask[": "mask", "BumpMap[": "bump map", "NormalMap[": "normal map"}
"""What changes a surface from place to place, by the head of its description; also where it is nested."""

UNBAKED = 2**32 - 1
"""Type of a shape without a bake."""


@dataclass(eq=False)
class SurfaceTypes:
    """Surface types of a scene: an index into the bakes for each shape.

    Attributes
    ----------
    names : tuple of str
        Name of each type: the shape id to which its bake was given.
    of_shape : dict of str to int
        Type of each shape with a bake, by shape id.
    table : mi.UInt32
        Type by number of the shape in Mitsuba's registry; `UNBAKED` without a bake.
    size : mi.UInt32
        Length of the table: shapes of shape groups may have greater numbers.
    """

    names: tuple[str, ...]
    of_shape: dict[str, int]
    table: mi.UInt32
    size: mi.UInt32 = field(init=False)

    def __post_init__(self) -> None:
        self.size = dr.opaque(mi.UInt32, len(self.table))  # opaque, so that scenes share kernels

    @classmethod
    def assign(cls, scene: ObjectScene, names: Sequence[str]) -> SurfaceTypes:
        """Assign types to the shapes of a scene.

        Parameters
        ----------
        scene : ObjectScene
            Scene.
        names : sequence of str
            Shape id of each type; `"*"` stands for all shapes that no other name mentions.

        Raises
        ------
        InputError
            If there is no shape of a name.
        """
        of_shape = {name: index for index, name in enumerate(names) if name != "*"}
        for name in of_shape:
            if name not in scene.shapes:
                there = f"there are: {', '.join(list(scene.shapes)[:12])}"
                fix = did_you_mean(name, scene.shapes) + there
                raise InputError(f"no shape '{name}'", where=scene.name, fix=fix)
        if "*" in names:
            rest = list(names).index("*")
            of_shape |= {name: rest for name in scene.shapes if name not in of_shape}
        return cls(tuple(names), of_shape, _table(scene.shapes, of_shape))

    def unbaked(self, scene: ObjectScene) -> list[str]:
        """Ids of the shapes without a bake."""
        return [name for name in scene.shapes if name not in self.of_shape]

    def of(self, surfaces: Surfaces) -> mi.UInt32:
        """Type of each surface; `UNBAKED` where there is none, or no surface."""
        known = surfaces.hit & (surfaces.shape < self.size)
        return dr.select(known, dr.gather(mi.UInt32, self.table, surfaces.shape, known), UNBAKED)


def lost_structure(name: str, bsdf: mi.BSDF | None) -> str:
    """Note on what the BSDF of a shape adds to its surface, and a bake in its place does not; empty if nothing.

    Parameters
    ----------
    name : str
        Id of the shape.
    bsdf : mi.BSDF or None
        Its BSDF in the scene.
    """
    if bsdf is None:
        return ""
    kinds = [what for kind, what in _STRUCTURES.items() if kind in str(bsdf)]
    return f"the {' and '.join(kinds)} of '{name}' {'are' if len(kinds) > 1 else 'is'} not used" if kinds else ""


def _table(shapes: Mapping[str, mi.Shape], of_shape: Mapping[str, int]) -> mi.UInt32:
    numbers = {name: int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for name, shape in shapes.items()}
    table = np.full(max(numbers.values()) + 1, UNBAKED, dtype=np.uint32)
    for name, index in of_shape.items():
        table[numbers[name]] = index
    return to_device(mi.UInt32, table)
