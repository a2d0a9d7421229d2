"""Renderer of a scene: everything that is prepared once for any number of pictures."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from rsibr import backend
from rsibr.errors import InputError
from rsibr.methods.method_set import MethodSet
from rsibr.methods.registry import default_method
from rsibr.shading.camera import Camera
from rsibr.shading.film import developed
from rsibr.shading.lookups.registry import Lookup, lookup_named
from rsibr.shading.object_scene import ObjectScene
from rsibr.shading.picture import Picture
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.store.bake import Bake, open_bake

RAYS = 16
"""Rays a pixel by default; fewer show at silhouettes."""
_MOST_RAYS = 4096


class ObjectRenderer:
    """A scene with its surface types, prepared once for any number of pictures.

    Parameters
    ----------
    scene : ObjectScene
        Shapes.
    bakes : mapping of str to Bake
        Bake of each shape, by shape id; `"*"` stands for all other shapes.
    method : str, optional
        Method of all bakes; by default that of `rsibr.reconstruct`.
    lookup : str
        How a surface takes its radiance from the method, one of `rsibr.shading.lookups.registry.lookups`.
    lookup_options : mapping, optional
        Options of the lookup by name, see `LookupRegistration.options`.

    Attributes
    ----------
    prepare_seconds : float
        Wall time of the preparation [s].
    """

    def __init__(
        self,
        scene: ObjectScene,
        bakes: Mapping[str, Bake],
        method: str | None = None,
        lookup: str = "pixel",
        lookup_options: Mapping[str, Any] | None = None,
    ) -> None:
        start = time.perf_counter()
        self.scene, self.bakes = scene, dict(bakes)
        self.types = SurfaceTypes.assign(scene, list(bakes))
        kind = lookup_named(lookup)
        options = kind.checked(lookup_options or {})
        methods = {path: MethodSet(bake) for path, bake in {bake.path: bake for bake in bakes.values()}.items()}
        self.methods = [methods[bake.path][method or default_method(bake)] for bake in bakes.values()]
        self.lookups: list[Lookup] = [kind.make(one, scene, **options) for one in self.methods]
        self.prepare_seconds = time.perf_counter() - start

    @backend.in_session
    def picture(self, camera: Camera, rays: int = RAYS) -> Picture:
        """Render a picture.

        Parameters
        ----------
        camera : Camera
            Camera.
        rays : int
            Rays spread over the square of each pixel, 1 to 4096.
        """
        if not 1 <= rays <= _MOST_RAYS:
            raise InputError(f"{rays} rays a pixel", where="rays", fix=f"give 1 to {_MOST_RAYS}")
        start = time.perf_counter()
        has_footprints = any(lookup.needs_footprint for lookup in self.lookups)
        shades = [lookup.toward(camera) for lookup in self.lookups]
        backend.synchronize()
        prepared = time.perf_counter() - start
        made = developed(self.scene, camera, self.types, shades, rays, has_footprints=has_footprints)
        backend.synchronize()
        seconds = time.perf_counter() - start - prepared
        return replace(made, seconds=seconds, prepare_seconds=self.prepare_seconds + prepared, notes=self.scene.notes)


def opened(bake: Bake | Path | str) -> Bake:
    """Open a bake, unless it is open."""
    return bake if isinstance(bake, Bake) else open_bake(Path(bake))
