"""Near field: an environment at a finite distance looks different from different places of the object."""

from __future__ import annotations

from rsibr.planning.plan import Effect, flagged
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.registry import register_effect

PARALLAX = 0.02
"""Radius over distance [rad] up to which parallax does not matter: about the width of a sharp clear coat's lobe."""


@register_effect("near_field", rank=40, switchable=False)
def near_field(evidence: Evidence) -> Effect:
    """Flag an environment that is near for the object's size."""
    distance = evidence.of_scene.environment_distance
    ratio = 0.0 if distance is None else evidence.scene.radius / max(distance, 1e-30)
    return flagged(
        "near_field", ratio, PARALLAX, "rad of parallax: the object's radius over the distance of the environment",
        "the surroundings are near, and reflections are those of far ones: they do not shift over the object",
        "not judged: how far the surroundings are is not known (environment_distance)"
        if distance is None
        else "the surroundings are far enough",
    )  # fmt: skip
