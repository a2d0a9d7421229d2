"""The methods by name: each is a way to mix the stored views and a way to look them up."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

import numpy as np

from rsibr import backend
from rsibr.bake.store import Bake
from rsibr.errors import InputError
from rsibr.geometry.spherical import area_weights
from rsibr.geometry.viewpoints import from_directions
from rsibr.reconstruct.blend import Mix, nearest_mix, triangle_mix
from rsibr.reconstruct.method import Cost, MeshMethod, Method
from rsibr.reconstruct.sources import SourceMaps
from rsibr.reconstruct.warp import WARPS, NoWarp, WarpBetween

_Recipe = Callable[[WarpBetween], tuple[type[Method], Mix, WarpBetween]]

_RECIPES: dict[str, _Recipe] = {
    "nearest": lambda _: (Method, nearest_mix, NoWarp.between),
    "blend": lambda _: (Method, triangle_mix(area_weights), NoWarp.between),
    "cabral1999": lambda warp: (Method, triangle_mix(area_weights), warp),
    "cabral1999-mesh": lambda warp: (MeshMethod, triangle_mix(area_weights), warp),
}

METHODS: tuple[str, ...] = tuple(_RECIPES)
"""Names of the methods.

`nearest`: the nearest stored view as it is. `blend`: the three around, weighted, unwarped. `cabral1999`: the paper as
printed, one warp for the material, area weights, fade near the singularity. `cabral1999-mesh`: the same through its
tessellated disk.
"""


class MethodSet:
    """The methods of one bake, sharing its maps on the device.

    Parameters
    ----------
    bake : Bake
        A finished bake.
    """

    def __init__(self, bake: Bake) -> None:
        backend.use()
        maps = [bake.map(index) for index in range(bake.view_count)]
        self._sources = SourceMaps.from_arrays(
            np.stack([np.sum(list(m.layers.values()), axis=0, dtype=np.float32) for m in maps]),  # lobes add up
            np.stack([m.coverage for m in maps]),
            np.stack([m.frame for m in maps]),
        )
        self._viewpoints = from_directions(bake.directions, bake.triangles)
        self._warp = WARPS[bake.manifest.material.warp]
        self._cost = Cost(bake.seconds, bake.bytes)
        self._made: dict[str, Method] = {}

    def __getitem__(self, name: str) -> Method:
        """Make the method `name`, or hand out the one already made.

        Raises
        ------
        InputError
            If no method has this name.
        """
        if name not in self._made:
            kind, mix, warp = _RECIPES[checked_name(name)](self._warp)
            self._made[name] = kind(name, self._viewpoints, self._sources, mix, warp, self._cost)
        return self._made[name]


def checked_name(name: str) -> str:
    """Return `name` where it is a method's; otherwise raise an InputError that says which there are."""
    if name in _RECIPES:
        return name
    near = get_close_matches(name, METHODS, 1)
    meant = f"did you mean '{near[0]}'? " if near else ""
    raise InputError(f"unknown method '{name}'", where="--method", fix=f"{meant}there are: {', '.join(METHODS)}")
