"""The methods by name: each is a way to mix the stored views and a way to look them up."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from functools import cache, cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import BakeError, InputError
from rsibr.geometry.spherical import area_weights, gnomonic_weights
from rsibr.geometry.viewpoints import Viewpoints, first_views, from_directions, icosphere
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import LobeShape
from rsibr.methods.protocol import Cost, MeshMethod, Method
from rsibr.methods.rsibr.delta_lobe import EXACT, ROUGH
from rsibr.methods.rsibr.lobe_albedo import LobeAlbedo
from rsibr.methods.rsibr.lobe_integral import LobeIntegral
from rsibr.methods.rsibr.residual_method import FineMethod, PrefilteredMethod, ResidualMethod
from rsibr.methods.rsibr.rsibr import PrefilteredLobes
from rsibr.methods.warp_blend.blend import Mix, nearest_mix, triangle_mix
from rsibr.methods.warp_blend.lobe_warp import Corrections, LobeGroup, LobeMaps, LobeWarpMethod, LobeWarps
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import WARPS, MirrorWarp, NoWarp, WarpBetween
from rsibr.store.layers import layer_of
from rsibr.store.manifest import LobeRecord
from rsibr.store.map_file import MapFile
from rsibr.store.stored_maps import StoredMaps

_Modelled = TypeVar("_Modelled", bound=ResidualMethod)

_Recipe = Callable[[WarpBetween], tuple[type[Method], Mix, WarpBetween]]

_RECIPES: dict[str, _Recipe] = {
    "nearest": lambda _: (Method, nearest_mix, NoWarp.between),
    "blend": lambda _: (Method, triangle_mix(area_weights), NoWarp.between),
    "cabral1999": lambda warp: (Method, triangle_mix(area_weights), warp),
    "cabral1999-mesh": lambda warp: (MeshMethod, triangle_mix(area_weights), warp),
}

METHODS: tuple[str, ...] = (*_RECIPES, "rsibr", "rsibr-fine")
"""Names of the methods.

`nearest`: the nearest stored view as it is. `blend`: the three around, weighted, unwarped. `cabral1999`: the paper as
printed, one warp for the material, area weights, fade near the singularity. `cabral1999-mesh`: the same through its
tessellated disk. `rsibr`: a model of all lobes, made of the light alone, and what it leaves unsaid at the stored views.
`rsibr-fine`: the same with a model that takes its time.
"""


class MethodSet:
    """The methods of one bake, sharing its maps on the device.

    Parameters
    ----------
    bake : StoredMaps
        A finished bake, or what stands in for one.
    """

    def __init__(self, bake: StoredMaps) -> None:
        backend.use()
        maps = [bake.map(index) for index in range(bake.view_count)]
        self._maps = maps
        self._lobes = bake.manifest.lobes
        self._sources = self._on_device([m.radiance for m in maps])
        self._bake = bake
        # Where one map was enough nothing is looked up between views: any will do
        self._viewpoints = from_directions(bake.directions, bake.triangles) if bake.has_views else icosphere(0)
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

    def lobed(self, corrections: Corrections) -> LobeWarpMethod:
        """Make the method that warps the lobes apart and knows nothing of the light, with what it does beyond warping.

        Each lobe is interpolated between the views that have a layer of it, which for some lobes may be fewer than all.

        Raises
        ------
        BakeError
            If the bake was made with `effects.lobes = "off"`.
        """
        groups: dict[int, list[LobeMaps]] = {}
        for record in self._kept_apart():
            images = [self._image(m, record.name) for m in self._seen(record.name)]
            lobe = LobeMaps.of(self._on_device(images), record.alpha, np.array(record.albedo))
            groups.setdefault(len(images), []).append(lobe)
        mix = triangle_mix(gnomonic_weights)
        return LobeWarpMethod(
            "rsibr-lobes",
            self._viewpoints,
            self._sources,
            mix,
            LobeWarps.between,
            self._cost,
            groups=[LobeGroup(self._first_views(count).on_device, lobes) for count, lobes in groups.items()],
            corrections=corrections,
        )

    def fine(self, *, uses_maps: bool | None = None, lobe: str | None = None) -> FineMethod:
        """Make the method `rsibr-fine`, its model alone, or the part of one lobe; see `prefiltered`."""
        kernels = self._kernels()
        chosen = kernels.values() if lobe is None else [kernels[lobe]]
        stack, light, density = self._stack, self._bake.light, self._mirror_density(uses_maps)
        lobes = [(LobeIntegral.of(kernel, stack, light, density), LobeAlbedo.of(albedo)) for kernel, albedo in chosen]
        return self._with_residuals(FineMethod, "rsibr-fine", lobe, uses_maps, lobes=lobes)

    def prefiltered(self, *, uses_maps: bool | None = None, lobe: str | None = None) -> PrefilteredMethod:
        """Make the method `rsibr`, its model alone, or the part of one lobe.

        Parameters
        ----------
        uses_maps : bool, optional
            Whether the stored maps say what the model does not; by default unless the bake holds one map alone.
        lobe : str, optional
            Only this lobe's part of the map: its model, and what that leaves unsaid of the lobe's own layer, carried as
            the whole's is, from the views that have one. Model, residual and the carrying of it are linear, so that the
            parts of all lobes add up to the method, as far as that cuts nothing off, where every view keeps all lobes
            apart. Where a lobe is done with fewer views, its residual comes from these alone in its part, and from all
            of them in the method: the parts miss the method by the difference of the two. A part may fall below zero.

        Raises
        ------
        BakeError
            If the bake was made with `effects.lobes = "off"`, or is too old to hold its light.
        KeyError
            If there is no such lobe.
        """
        kernels, stack, light = self._kernels(), self._stack, self._bake.light
        density = self._mirror_density(uses_maps)
        lobes, part = list(kernels.values()), None if lobe is None else kernels[lobe][0]

        @cache
        def by_itself() -> Method:
            shared = lobe is None and uses_maps is None
            return self["rsibr-fine"] if shared else self.fine(uses_maps=uses_maps, lobe=lobe)

        return self._with_residuals(
            PrefilteredMethod,
            "rsibr",
            lobe,
            uses_maps,
            prefilter=lambda resolution: PrefilteredLobes.of(lobes, stack, light, resolution, part, density),
            by_itself=by_itself,
        )

    def _with_residuals(
        self, kind: type[_Modelled], name: str, lobe: str | None, uses_maps: bool | None, **rest: Any
    ) -> _Modelled:
        """Make a method with a model, and put into its sources what the model leaves unsaid, over the whole albedo."""
        albedo = LobeAlbedo.of(np.sum([np.array(record.albedo) for record in self._lobes], axis=0))
        seen, mix = self._seen(lobe), triangle_mix(gnomonic_weights)
        common = (self._first_views(len(seen)), self._sources, mix, MirrorWarp.between, self._cost)
        is_part, carries = lobe is not None, self._carries(uses_maps)
        title = f"{name}/{lobe}" if is_part else name
        negatives = is_part or self._bake.rendering != "rgb"
        made = kind(title, *common, albedo=albedo, uses_maps=carries, keeps_negatives=negatives, **rest)
        if not carries:
            return made
        residuals = [made.left_over(self._image(m, lobe), m.frame) for m in seen]
        made.sources = self._on_device(residuals)
        return made

    def _carries(self, uses_maps: bool | None) -> bool:
        return self._bake.has_views if uses_maps is None else uses_maps

    def _mirror_density(self, uses_maps: bool | None) -> float:
        return ROUGH if self._carries(uses_maps) else EXACT

    def _kernels(self) -> dict[str, tuple[LobeShape, NDArray[np.float64]]]:
        """Kernel and directional albedo of each lobe."""
        return {record.name: (lobe_shape(record), np.array(record.albedo)) for record in self._kept_apart()}

    def _seen(self, lobe: str | None) -> list[MapFile]:
        """Maps that have a layer of a lobe, the first so many; all for the sum of the lobes."""
        return self._maps[: {record.name: record.views for record in self._lobes}[lobe]] if lobe else self._maps

    def _image(self, map_file: MapFile, lobe: str | None) -> NDArray[np.float32]:
        return map_file.layers[layer_of(lobe, self._lobes)] if lobe else map_file.radiance

    def _first_views(self, count: int) -> Viewpoints:
        return first_views(self._viewpoints, count) if self._bake.has_views else self._viewpoints

    @cached_property
    def _stack(self) -> EnvironmentPyramid:
        return EnvironmentPyramid.of(self._bake.light.picture)

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
            return self.prefiltered()
        if name == "rsibr-fine":
            return self.fine()
        if not self._bake.has_views:
            raise BakeError(
                f"it holds one map, for its lobes have closed forms, and '{name}' needs views all around",
                where=str(self._bake.path),
                fix='bake with effects.view_dependence = "on", or use rsibr',
            )
        kind, mix, warp = _RECIPES[name](self._warp)
        return kind(name, self._viewpoints, self._sources, mix, warp, self._cost)

    def _on_device(self, images: list[NDArray[np.float32]]) -> SourceMaps:
        """Images of the first so many views."""
        seen = self._maps[: len(images)]
        coverage, frames = (np.stack([getattr(m, part) for m in seen]) for part in ("coverage", "frame"))
        return SourceMaps.from_arrays(np.stack(images), coverage, frames)


def available(bake: StoredMaps) -> tuple[str, ...]:
    """Names of the methods that a bake has all for: those of 1999 need its views, and ours its lobes and its light."""
    modelled = bake.manifest.lobes and bake.manifest.light is not None
    of_views, of_light = tuple(_RECIPES), tuple(name for name in METHODS if name not in _RECIPES)
    return (*(of_views if bake.has_views else ()), *(of_light if modelled else ()))


def checked_name(name: str) -> str:
    """Return `name` where it is a method's; otherwise raise an InputError that says which there are."""
    if name in METHODS:
        return name
    near = get_close_matches(name, METHODS, 1)
    meant = f"did you mean '{near[0]}'? " if near else ""
    raise InputError(f"unknown method '{name}'", where="--method", fix=f"{meant}there are: {', '.join(METHODS)}")


def lobe_shape(record: LobeRecord) -> LobeShape:
    """Kernel of a stored lobe, from the proxies that stand in for it; one without any is a mirror."""
    if not record.proxies:
        return LobeShape.mirror()
    alphas = tuple(proxy.alpha for proxy in record.proxies)
    return LobeShape.of(ProxyLobe(alphas, tuple(np.array(proxy.coefficients) for proxy in record.proxies)))
