"""Self-occlusion: the object hides a part of the sky from itself."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rsibr.planning.plan import Effect, decided
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.registry import register_effect
from rsibr.shading.occlusion.self_visibility import TypeVisibility

HIDDEN = 5e-3
"""Share of the sky up to which hiding it does not matter: its square is below the error of the methods."""

_METAL = "metal shows the whole sky: darkening its reflections where the object is in the way made pictures worse"


@register_effect("self_occlusion", rank=20)
def self_occlusion(evidence: Evidence) -> Effect:
    """Decide whether the matte part is darkened by vertex, and dielectric gloss by a mirror ray."""
    types = evidence.of_scene.visibility
    dielectrics = [one for one in types if not one.is_metal]
    hidden = mean_of(types, "sky_hidden")
    effect = decided(
        "self_occlusion", evidence.switch("self_occlusion"), hidden, HIDDEN, "of the sky hidden by the object",
        f"the object hides sky from itself: {_by_lobe(dielectrics or types)}{_unbaked(evidence)}",
        "the object hides next to nothing from itself", error_if_left_out=min(1.0, mean_of(types, "error_without")),
    )  # fmt: skip
    if dielectrics or not effect.on:
        return effect
    return replace(effect, on=False, why=f"{_METAL}: {_by_lobe(types)}")


def mean_of(types: Iterable[TypeVisibility], name: str) -> float:
    """Mean of an attribute over the surface types, by how much of the object each is; 0 if none is seen."""
    weights = [(one.weight, float(getattr(one, name))) for one in types]
    total = sum(weight for weight, _ in weights)
    return sum(weight * value for weight, value in weights) / total if total else 0.0


def _unbaked(evidence: Evidence) -> str:
    names = evidence.of_scene.types.unbaked(evidence.scene)
    return f"; shapes without a bake hide the sky and reflect nothing: {', '.join(names)}" if names else ""


def _by_lobe(types: Iterable[TypeVisibility]) -> str:
    kept = list(types)
    matte, mirror = 100 * mean_of(kept, "matte_hidden"), 100 * mean_of(kept, "mirror_hidden")
    return f"{matte:.1f} % of the irradiance and {mirror:.1f} % of the mirror directions are hidden"
