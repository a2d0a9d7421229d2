"""One map indexed by the surface normal: the paper's lookup for surfaces whose central direction is the normal."""

from __future__ import annotations

from rsibr.errors import InputError
from rsibr.methods.protocol import Method
from rsibr.shading.lookups.one_map import OneMap
from rsibr.shading.lookups.registry import register_lookup
from rsibr.shading.maps.indexing import BY_NORMAL
from rsibr.shading.maps.maker import RESOLUTION
from rsibr.shading.maps.mixed_chain import BY_NORMAL_OF_ALL, MixedChain
from rsibr.shading.scenes.object_scene import ObjectScene


@register_lookup("map-normal", summary="one map of the view direction, by the normal")
def map_normal(
    method: Method,
    scene: ObjectScene,  # noqa: ARG001
    *,
    filter: str = "none",
    resolution: int = RESOLUTION,
    chain: str = "normal",
) -> OneMap:
    """Make the lookup.

    Parameters
    ----------
    method, scene, filter, resolution
        See `OneMap`.
    chain : {"normal", "mixed"}
        Whether the map holds the normals that face the view, as all sphere maps, or all normals: `MixedChain`.
    """
    if chain == "normal":
        return OneMap(method, BY_NORMAL, filter, resolution)
    if chain == "mixed":
        return OneMap(MixedChain(method), BY_NORMAL_OF_ALL, filter, resolution)
    raise InputError(f"no chain '{chain}'", where="chain", fix="give one of: normal, mixed")
