"""`nearest` and `blend`: stored maps without a warp; the simple methods that Cabral et al. (1999) improve on."""

from __future__ import annotations

from rsibr.methods.inputs import MethodInputs
from rsibr.methods.protocol import Needs
from rsibr.methods.registry import register
from rsibr.methods.warp_blend.blend import WEIGHTS, nearest_mix, triangle_mix
from rsibr.methods.warp_blend.warp import NoWarp
from rsibr.methods.warp_blend.warp_blend import WarpBlend


@register("nearest", summary="the nearest stored map, unwarped", needs=Needs(views=True), rank=10)
def nearest(inputs: MethodInputs) -> WarpBlend:
    """Make the method that shows the nearest stored map."""
    return WarpBlend("nearest", inputs.viewpoints, inputs.sources, nearest_mix, NoWarp)


@register("blend", summary="the three stored maps around the view, blended unwarped", needs=Needs(views=True), rank=20)
def blend(inputs: MethodInputs, *, weights: str = "area") -> WarpBlend:
    """Make the method that blends the three stored maps around the view with `weights`, one of `WEIGHTS`."""
    return WarpBlend("blend", inputs.viewpoints, inputs.sources, triangle_mix(WEIGHTS[weights]), NoWarp)
