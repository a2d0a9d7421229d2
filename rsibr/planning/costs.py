"""Cost or saving of each effect in seconds and bytes, from measurements of this scene on this machine."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rsibr.planning.plan import Effect, Plan
from rsibr.planning.views import own_views, parts_spared

_RADIANCE, _VARIANCE, _COVERAGE = 3, 3, 1
"""Channels of a lobe's layer and of the sum of several, of the variance, of the coverage."""


@dataclass(frozen=True)
class Costs:
    """Measured time and size of one map, and of its alternatives.

    Attributes
    ----------
    views, lobes : int
        Number of views in the config; layers of a map.
    seconds : float
        Render time of a map as planned [s].
    bytes : int
        Size of a map as planned with a layer for each lobe.
    one_lobe, other_colour, other_sampling, other_rendering : float or None
        Render times of a map [s] without the split into lobes; with three channels if one is planned, or vice versa;
        with light sampling if it is not planned, or vice versa; in RGB if spectra are planned, or vice versa. None if
        not measured.
    overhead_seconds : float
        Time of the whole bake beside its maps [s]: start-up, loading, probes, compilation, the light, storing.
    light_bytes : int
        Size of the light, of which the bake holds one.
    other_colour_bytes : int or None
        Size of a map with three channels if one is planned, or vice versa. None if not measured.
    source : str
        Origin of the figures, for display.
    """

    views: int
    lobes: int
    seconds: float
    bytes: int
    one_lobe: float | None = None
    other_colour: float | None = None
    other_sampling: float | None = None
    other_rendering: float | None = None
    other_colour_bytes: int | None = None
    overhead_seconds: float = 0.0
    light_bytes: int = 0
    source: str = ""


def priced(plan: Plan, costs: Costs, asked_resolution: int) -> Plan:
    """Return the plan with the cost of each effect, or its saving if it is off.

    Parameters
    ----------
    plan : Plan
        A plan without costs.
    costs : Costs
        Measurements of one map.
    asked_resolution : int
        Texels a side in the config.
    """
    effects = tuple(_priced(effect, plan, costs, asked_resolution) for effect in plan.effects)
    seconds = costs.overhead_seconds + _baked(plan, costs) * costs.seconds
    size = costs.light_bytes + _whole_bytes(plan, costs)
    return replace(plan, effects=effects, seconds=seconds, bytes=size, costs_from=costs.source)


def _whole_bytes(plan: Plan, costs: Costs) -> int:
    """Bytes of all maps, without the parts that some views omit."""
    return _baked(plan, costs) * costs.bytes - _parts_bytes(_parts_left_out(plan, costs), costs)


def _parts_left_out(plan: Plan, costs: Costs) -> int:
    return parts_spared([lobe.own_views or costs.views for lobe in plan.lobes], costs.views)


def _baked(plan: Plan, costs: Costs) -> int:
    """Number of maps that are baked: one if no lobe needs stored views."""
    return costs.views if plan.needs_views else 1


def _priced(effect: Effect, plan: Plan, costs: Costs, asked: int) -> Effect:
    seconds: float | None
    size: int | None
    views = _baked(plan, costs)
    whole = views * costs.seconds, _whole_bytes(plan, costs)
    match effect.name:
        case "view_dependence":
            left_out = _parts_bytes(_parts_left_out(plan, costs), costs)
            seconds, size = (costs.views - 1) * costs.seconds, (costs.views - 1) * costs.bytes - left_out
        case "diffuse" | "glossy" | "clear_coat" | "mirror":
            if not effect.on and effect.forced is None:
                return effect  # the material has no such lobe
            seconds, size = _of_a_lobe(plan, costs)
        case "lobe_views":
            if not effect.threshold:
                return effect  # all views have the same layers
            fewest = parts_spared(own_views(plan.lobes, int(effect.threshold)), costs.views)
            seconds, size = 0.0, _parts_bytes(fewest if effect.on else _parts_left_out(plan, costs), costs)
        case "colour":
            seconds, size = _apart(effect.on, costs, costs.other_colour), _of_colour(costs)
        case "light_sampling":
            seconds, size = _apart(effect.on, costs, costs.other_sampling), 0
        case "resolution":
            # On: cost beyond half the resolution. Off: saving beyond the resolution that was chosen
            factor = 0.75 if effect.on else (asked / plan.resolution) ** 2 - 1
            seconds, size = factor * whole[0], round(factor * whole[1])
        case "spectral":  # maps are stored in RGB either way
            seconds, size = _apart(effect.on, costs, costs.other_rendering), 0
        case "polarisation":  # not measured apart from the spectral rendering that it implies
            seconds, size = None, 0
        case _:
            return effect
    return effect.costing(seconds, size)


def _of_a_lobe(plan: Plan, costs: Costs) -> tuple[float | None, int | None]:
    """Cost of a lobe: its layer and its share of the split; the only lobe of a material costs the whole bake."""
    if costs.lobes == 1 and not plan.left_out:
        return costs.views * costs.seconds, costs.views * costs.bytes
    apart = _apart(True, costs, costs.one_lobe)
    own = 2 if costs.lobes == 2 else 1  # the last lobe but one takes the sum with it
    size = _parts_bytes(own * costs.views, costs) - _parts_bytes(_parts_left_out(plan, costs), costs) // costs.lobes
    return None if apart is None else apart / max(costs.lobes - 1, 1), size


def _of_colour(costs: Costs) -> int | None:
    """Difference in bytes between one channel and three; small, because compression removes equal channels."""
    if costs.other_colour_bytes is None:
        return None
    return costs.views * abs(costs.other_colour_bytes - costs.bytes)


def _parts_bytes(parts: int, costs: Costs) -> int:
    """Bytes of a number of layers or sums, if all channels compress equally; several layers come with a sum."""
    radiance = _RADIANCE * (costs.lobes + (costs.lobes > 1))
    return round(parts * costs.bytes * _RADIANCE / (radiance + _VARIANCE + _COVERAGE))


def _apart(is_on: bool, costs: Costs, other: float | None) -> float | None:
    """Seconds over all views that an effect costs if on, or saves if off; 0 if noise made the difference negative."""
    if other is None:
        return None
    return costs.views * max(0.0, costs.seconds - other if is_on else other - costs.seconds)
