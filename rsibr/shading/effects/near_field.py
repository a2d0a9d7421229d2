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
        "bakes are lit from infinity: reflections do not shift with the place",
        "the environment is taken to be at infinity" if distance is None else "the environment is far enough",
    )  # fmt: skip
