"""The methods by name: each is a way to mix the stored views and a way to look them up."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.bake.manifest import LobeRecord
from rsibr.bake.store import Bake
from rsibr.errors import BakeError, InputError
from rsibr.geometry.spherical import area_weights, gnomonic_weights
from rsibr.geometry.viewpoints import from_directions
from rsibr.reconstruct.blend import Mix, nearest_mix, triangle_mix
from rsibr.reconstruct.light_stack import LightStack
from rsibr.reconstruct.lobed import Corrections, LobedMethod, LobeMaps, LobeWarps
from rsibr.reconstruct.method import Cost, MeshMethod, Method
from rsibr.reconstruct.modelled import ModelledMethod, modelled_lobe
from rsibr.reconstruct.sources import SourceMaps
from rsibr.reconstruct.warp import WARPS, MirrorWarp, NoWarp, WarpBetween

_Recipe = Callable[[WarpBetween], tuple[type[Method], Mix, WarpBetween]]

_RECIPES: dict[str, _Recipe] = {
    "nearest": lambda _: (Method, nearest_mix, NoWarp.between),
    "blend": lambda _: (Method, triangle_mix(area_weights), NoWarp.between),
    "cabral1999": lambda warp: (Method, triangle_mix(area_weights), warp),
    "cabral1999-mesh": lambda warp: (MeshMethod, triangle_mix(area_weights), warp),
}

METHODS: tuple[str, ...] = (*_RECIPES, "rsibr")
"""Names of the methods.

`nearest`: the nearest stored view as it is. `blend`: the three around, weighted, unwarped. `cabral1999`: the paper as
printed, one warp for the material, area weights, fade near the singularity. `cabral1999-mesh`: the same through its
tessellated disk. `rsibr`: the best that we know, lobes warped apart, albedo carried with the surface, footprints
corrected, gnomonic weights.
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
        self._maps = maps
        self._lobes = bake.manifest.lobes
        self._sources = self._on_device([m.radiance for m in maps])
        self._bake = bake
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
            self._made[name] = self._make(checked_name(name))
        return self._made[name]

    def lobed(self, corrections: Corrections) -> LobedMethod:
        """Make the lobes warped apart, without the light: what `rsibr` was before it had a model, to see what each gains.

        Raises
        ------
        BakeError
            If the bake was made with `effects.lobes = "off"`.
        """
        lobes = []
        for record in self._kept_apart():
            layer = record.name if len(self._lobes) > 1 else "radiance"
            sources = self._on_device([m.layers[layer] for m in self._maps])
            lobes.append(LobeMaps.of(sources, record.alpha, np.array(record.albedo)))
        mix = triangle_mix(gnomonic_weights)
        return LobedMethod(
            "rsibr-lobes",
            self._viewpoints,
            self._sources,
            mix,
            LobeWarps.between,
            self._cost,
            lobes=lobes,
            corrections=corrections,
        )

    def modelled(self, *, uses_maps: bool = True) -> ModelledMethod:
        """Make the method `rsibr`, or the model of the lobes alone.

        Raises
        ------
        BakeError
            If the bake was made with `effects.lobes = "off"`, or is too old to hold its light.
        """
        stack = LightStack.of(self._bake.light)
        lobes = [modelled_lobe(record, stack, self._bake.light) for record in self._kept_apart()]
        mix = triangle_mix(gnomonic_weights)
        method = ModelledMethod(
            "rsibr",
            self._viewpoints,
            self._sources,
            mix,
            MirrorWarp.between,
            self._cost,
            lobes=lobes,
            uses_maps=uses_maps,
        )
        method.sources = self._on_device([method.left_over(m.radiance, m.frame) for m in self._maps])
        return method

    def _kept_apart(self) -> tuple[LobeRecord, ...]:
        if not self._lobes:
            raise BakeError(
                "its lobes were not kept apart",
                where=str(self._bake.path),
                fix='bake with effects.lobes = "auto" for rsibr',
            )
        return self._lobes

    def _make(self, name: str) -> Method:
        if name == "rsibr":
            return self.modelled()
        kind, mix, warp = _RECIPES[name](self._warp)
        return kind(name, self._viewpoints, self._sources, mix, warp, self._cost)

    def _on_device(self, images: list[NDArray[np.float32]]) -> SourceMaps:
        coverage, frames = (np.stack([getattr(m, part) for m in self._maps]) for part in ("coverage", "frame"))
        return SourceMaps.from_arrays(np.stack(images), coverage, frames)


def available(bake: Bake) -> tuple[str, ...]:
    """Names of the methods that a bake has all for: `rsibr` needs its lobes kept apart."""
    return METHODS if bake.manifest.lobes else tuple(_RECIPES)


def checked_name(name: str) -> str:
    """Return `name` where it is a method's; otherwise raise an InputError that says which there are."""
    if name in METHODS:
        return name
    near = get_close_matches(name, METHODS, 1)
    meant = f"did you mean '{near[0]}'? " if near else ""
    raise InputError(f"unknown method '{name}'", where="--method", fix=f"{meant}there are: {', '.join(METHODS)}")
