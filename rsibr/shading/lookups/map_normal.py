"""One map indexed by the surface normal: the paper's lookup for surfaces whose central direction is the normal."""

from __future__ import annotations

from rsibr.methods.protocol import Method
from rsibr.shading.lookups.one_map import OneMap
from rsibr.shading.lookups.registry import register_lookup
from rsibr.shading.maps.indexing import BY_NORMAL
from rsibr.shading.maps.maker import RESOLUTION
from rsibr.shading.object_scene import ObjectScene


@register_lookup("map-normal", summary="one map of the view direction, by the normal")
def map_normal(
    method: Method,
    scene: ObjectScene,  # noqa: ARG001
    *,
    filter: str = "none",
    resolution: int = RESOLUTION,
) -> OneMap:
    """Make the lookup; for its options see `OneMap`."""
    return OneMap(method, BY_NORMAL, filter, resolution)
