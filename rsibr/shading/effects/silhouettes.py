"""Silhouettes: pixels that the object covers in part need several rays."""

from __future__ import annotations

from rsibr.planning.plan import Effect, decided
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.registry import register_effect

ONE_RAY_ERROR = 0.32
"""relMSE of one ray a pixel on silhouettes; .14, .018, .0023 with 4, 16, 64 (a clear-coat bunny)."""

SHARE = 1e-3
"""Share of the pixels up to which silhouettes do not matter."""

_TURNS = 3.5  # length of an outline over the diameter of a disk of the same area, more for what is not round


@register_effect("silhouettes", rank=50)
def silhouettes(evidence: Evidence) -> Effect:
    """Decide whether pixels get more than one ray."""
    share = evidence.silhouette_share
    if share is None:
        share = _foreseen(evidence)
    is_on = evidence.rays > 1
    switch = "auto" if is_on == (share > SHARE) else "on" if is_on else "off"
    return decided(
        "silhouettes", switch, share, SHARE, "of the covered pixels are covered in part",
        f"{evidence.rays} rays a pixel", "the object has no silhouette in the picture",
        error_if_left_out=ONE_RAY_ERROR * share,
    )  # fmt: skip


def _foreseen(evidence: Evidence) -> float:
    """Share of partly covered pixels if the object filled a disk of its bounding sphere's size."""
    camera, distance = evidence.camera, max(evidence.distance, 1e-30)
    diameter = evidence.scene.radius / (distance * camera.half_width) * camera.width
    return min(1.0, _TURNS / max(diameter, 1.0))
