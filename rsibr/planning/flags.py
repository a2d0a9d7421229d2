"""Effects that sphere maps cannot represent or never need: detected in the material and reported."""

from __future__ import annotations

from collections.abc import Iterator

from rsibr.lobes.bsdf_eval import RETRO_RATIO
from rsibr.planning.material_probe import MaterialProbe
from rsibr.planning.plan import Effect, flagged

TURNS_ALIKE = 1e-2
"""Relative change of the BRDF under rotation about the normal up to which a material counts as isotropic."""

SAME_ALL_OVER = 1e-3
"""Relative change of the BRDF over the surface up to which a material counts as homogeneous."""


def flag_effects(material: MaterialProbe) -> Iterator[Effect]:
    """Yield the effects that maps cannot represent: off in every bake, flagged if the material shows them."""
    yield flagged(
        "retroreflection", material.retro_ratio, RETRO_RATIO, "BRDF toward the light over that to the side",
        "neither model nor warp follows retroreflected light: expect larger errors between the views",
        "no light is retroreflected",
    )  # fmt: skip
    yield flagged(
        "anisotropy", material.anisotropy, TURNS_ALIKE, "relative change of the BRDF under rotation",
        "a sphere map holds one radiance a normal: expect larger errors between the views",
        "the material is isotropic",
    )  # fmt: skip
    yield flagged(
        "spatial_variation", material.variation, SAME_ALL_OVER, "relative change of the BRDF over the surface",
        "the lobes are those of one place, and warped residuals mix places: expect larger errors between the views",
        "the material is homogeneous",
    )  # fmt: skip


def use_effects() -> Iterator[Effect]:
    """Yield the effects that sphere maps exclude exactly."""
    yield flagged(
        "self_occlusion", 0.0, 0.0, "share of the light that the object occludes", "",
        "a sphere is convex: it neither shadows nor reflects itself",
    )  # fmt: skip
    yield flagged(
        "perspective", 0.0, 0.0, "spread of the view over a map [rad]", "",
        "maps are orthographic: one view direction each",
    )  # fmt: skip
