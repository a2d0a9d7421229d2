"""What sphere maps cannot hold, or never need: looked for in the material, and said."""

from __future__ import annotations

from collections.abc import Iterator

from rsibr.lobes.bsdf_eval import RETRO_RATIO
from rsibr.planning.material_probe import MaterialProbe
from rsibr.planning.plan import Effect, flagged

TURNS_ALIKE = 1e-2
"""Change of the BRDF under a turn about the normal, relative, up to which a material counts as isotropic."""

SAME_ALL_OVER = 1e-3
"""Change of the BRDF from place to place, relative, up to which a material counts as the same all over."""


def flag_effects(material: MaterialProbe) -> Iterator[Effect]:
    """Look for what maps cannot hold; off in every bake, flagged where it matters."""
    yield flagged(
        "retroreflection", material.retro_ratio, RETRO_RATIO, "straight back over sideways",
        "no warp follows light that goes back: it is baked with the other lobes, and errs more between the views",
        "no light goes back to where it came from",
    )  # fmt: skip
    yield flagged(
        "anisotropy", material.anisotropy, TURNS_ALIKE, "change of the BRDF under a turn, relative",
        "a sphere map holds one look a normal: expect larger errors between the views",
        "the material looks the same however it is turned",
    )  # fmt: skip
    yield flagged(
        "spatial_variation", material.variation, SAME_ALL_OVER, "change of the BRDF from place to place, relative",
        "a sphere map holds one material: it is that of one place", "the material is the same all over",
    )  # fmt: skip


def use_effects() -> Iterator[Effect]:
    """What the use of sphere maps rules out, exactly."""
    yield flagged(
        "self_occlusion", 0.0, 0.0, "share of the light that the object shadows", "",
        "a sphere is convex: nothing of it shadows or mirrors itself",
    )  # fmt: skip
    yield flagged(
        "perspective", 0.0, 0.0, "spread of the view over a map [rad]", "",
        "maps are orthographic: one view direction each",
    )  # fmt: skip
