"""Back-facing normals: shading normals that no surface could have there, made safe before a method sees them."""

from __future__ import annotations

from rsibr.planning.plan import Effect
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.registry import register_effect

SHARE = 0.0
"""Share of the rays up to which it does not matter; methods give a rim's value or NaN for each such normal."""


@register_effect("back_facing", rank=60, switchable=False)
def back_facing(evidence: Evidence) -> Effect:
    """Say how many shading normals were made safe; this is always done."""
    counts = evidence.counts
    unit = "of the rays met a normal that was made safe"
    if counts is None:
        return Effect("back_facing", True, None, 0.0, SHARE, unit, "counted in each picture", error_if_left_out=None)
    share = (counts.replaced + counts.flipped + counts.bent) / max(counts.hits, 1)
    why = (
        f"{counts.replaced} replaced by the geometric normal, {counts.flipped} flipped, {counts.bent} bent to the "
        f"horizon; {counts.back} rays saw the inner side"
    )
    return Effect("back_facing", True, None, share, SHARE, unit, why, error_if_left_out=None)
