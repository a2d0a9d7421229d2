"""One map indexed by the mirror direction of each pixel's own view, as OpenGL's sphere mapping with perspective.

Cabral et al. (1999), sections 2 and 3.3: the hardware reflects the view of each vertex and looks up g_mirror⁻¹ of it.
"""

from __future__ import annotations

from rsibr.methods.protocol import Method
from rsibr.shading.lookups.one_map import OneMap
from rsibr.shading.lookups.registry import register_lookup
from rsibr.shading.maps.indexing import BY_REFLECTION
from rsibr.shading.maps.maker import RESOLUTION
from rsibr.shading.scenes.object_scene import ObjectScene


@register_lookup("map-reflection", summary="one map of the view direction, by the reflection of each pixel's view")
def map_reflection(
    method: Method,
    scene: ObjectScene,  # noqa: ARG001
    *,
    filter: str = "none",
    resolution: int = RESOLUTION,
) -> OneMap:
    """Make the lookup; for its options see `OneMap`."""
    return OneMap(method, BY_REFLECTION, filter, resolution)
