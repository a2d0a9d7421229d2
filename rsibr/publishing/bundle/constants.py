"""Constants of the methods that the page's shaders take from Python."""

from __future__ import annotations

from rsibr.methods.warp_blend.warp import FADE_RADIUS, LEAST_CONFIDENCE


def constants() -> dict[str, float]:
    """Constants by the name that they have in GLSL and JavaScript."""
    return {"FADE_RADIUS": FADE_RADIUS, "LEAST_CONFIDENCE": LEAST_CONFIDENCE}
