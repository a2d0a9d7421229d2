"""Interreflection: light that reaches a surface by way of another."""

from __future__ import annotations

from dataclasses import replace

from rsibr.planning.plan import Effect, decided
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.registry import register_effect
from rsibr.shading.effects.self_occlusion import mean_of, self_occlusion

BOUNCED = 2e-3
"""Share of the arriving light up to which bounces do not matter."""


@register_effect("interreflection", rank=30)
def interreflection(evidence: Evidence) -> Effect:
    """Decide whether vertices receive what other surfaces reflect, and mirror rays show it."""
    types, switch = evidence.of_scene.visibility, evidence.switch("interreflection")
    effect = decided(
        "interreflection", switch, mean_of(types, "bounced"), BOUNCED, "of the arriving light by way of the object",
        "surfaces reflect light onto each other", "surfaces reflect next to nothing onto each other",
        error_if_left_out=min(1.0, mean_of(types, "error_without_bounces")),
    )  # fmt: skip
    if effect.on and not self_occlusion(evidence).on:
        return replace(effect, on=False, why="it comes with self_occlusion, which is off")
    return effect
