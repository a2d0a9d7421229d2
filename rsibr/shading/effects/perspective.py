"""Perspective: the view direction changes over the object, and a sphere map holds one."""

from __future__ import annotations

import math

from rsibr.planning.plan import Effect, decided
from rsibr.shading.effects.evidence import Evidence
from rsibr.shading.effects.registry import register_effect
from rsibr.shading.lookups.registry import lookups

PIXEL, GRID, ONE_MAP = "pixel", "map-grid", "map-reflection"
"""Lookups between which the spread decides: a pixel's own view, maps over the picture, one map by reflection."""

SLOPE = 0.11
"""relMSE of one map by reflection over the squared half-angle of view [rad⁻²]: .0010, .013, .036 at 10°, 40°, 70° on
plastic, clear coat alike (geometric means over four objects, sky `city`)."""

GRID_SIDE = 5
"""Maps a side of the grid: each has this share of the spread."""

TOLERATED = 1e-4
"""relMSE up to which maps serve: about that of the method with a view of its own for each pixel."""

ONE_MAP_SPREAD = math.sqrt(TOLERATED / SLOPE)
"""Spread [rad] up to which one map serves."""

GRID_SPREAD = GRID_SIDE * ONE_MAP_SPREAD
"""Spread [rad] up to which a grid of maps serves."""


def spread(evidence: Evidence) -> float:
    """Greatest angle [rad] between the view directions of the object and that of its middle; π from inside of it."""
    radius, distance = evidence.scene.radius, evidence.distance
    if distance <= radius:
        return math.pi
    seen = math.asin(radius / distance)
    half_diagonal = math.atan(
        math.hypot(1, evidence.camera.height / evidence.camera.width) * evidence.camera.half_width
    )
    return min(seen, 2 * half_diagonal)


@register_effect("perspective", rank=10)
def perspective(evidence: Evidence) -> Effect:
    """Decide whether one map serves the picture."""
    angle, switch = spread(evidence), evidence.switch("perspective")
    if switch == "auto" and evidence.lookup != "auto":
        is_on = not is_one_map(evidence.lookup)
        switch = "auto" if is_on == (angle > ONE_MAP_SPREAD) else "on" if is_on else "off"
    error = min(1.0, SLOPE * angle * angle)
    return decided(
        "perspective", switch, angle, ONE_MAP_SPREAD, "rad of view over the object",
        "each part of the object has a view of its own", "one map serves the whole object",
        error_if_left_out=error,
    )  # fmt: skip


def is_one_map(lookup: str) -> bool:
    """Whether a lookup takes the whole object from one map."""
    return lookup.startswith("map") and lookup != GRID


def lookup_for(effect: Effect, asked: str = "auto") -> str:
    """Lookup that the effect calls for.

    Parameters
    ----------
    effect : Effect
        Decision on `perspective`.
    asked : str
        Lookup that was asked for, kept where it is of the kind decided on; "auto" if none was.

    Returns
    -------
    str
        A pixel's own view where the cheaper ones are not installed.
    """
    if asked != "auto" and is_one_map(asked) != effect.on:
        return asked
    wanted = ONE_MAP if not effect.on else GRID if effect.evidence <= GRID_SPREAD and effect.forced is None else PIXEL
    return wanted if wanted in lookups() else PIXEL
