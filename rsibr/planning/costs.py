"""What each effect costs the bake, or saves it: from times and sizes measured of this scene on this machine."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rsibr.planning.plan import Effect, Plan
from rsibr.planning.views import layers_spared, own_views

_RADIANCE, _VARIANCE, _COVERAGE = 3, 3, 1
"""Channels of a lobe's layer, of the variance, of the coverage."""


@dataclass(frozen=True)
class Costs:
    """Times and sizes of one map.

    Attributes
    ----------
    views, lobes : int
        Maps all around, as the config asks for; and layers of each.
    seconds : float
        Of a map as planned.
    bytes : int
        Of a map as planned that keeps all lobes apart.
    one_lobe, other_colour, other_sampling, other_rendering : float or None
        Seconds of a map with its lobes not kept apart; with three channels where one is planned, or the reverse; with
        light samples where none are planned, or the reverse; in RGB where spectra are planned, or the reverse. None
        where not measured.
    other_colour_bytes : int or None
        Of a map with three channels where one is planned, or the reverse.
    source : str
        Where the figures come from.
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
    source: str = ""


def priced(plan: Plan, costs: Costs, asked_resolution: int) -> Plan:
    """Return the plan with what each effect costs, or saves where it is off.

    Parameters
    ----------
    plan : Plan
    costs : Costs
    asked_resolution : int
        Texels a side that the config asked for.
    """
    effects = tuple(_priced(effect, plan, costs, asked_resolution) for effect in plan.effects)
    seconds = _baked(plan, costs) * costs.seconds
    return replace(plan, effects=effects, seconds=seconds, bytes=_whole_bytes(plan, costs), costs_from=costs.source)


def _whole_bytes(plan: Plan, costs: Costs) -> int:
    """Bytes of all maps: those of the layers that some views do not have are not among them."""
    return _baked(plan, costs) * costs.bytes - _layers_bytes(_layers_left_out(plan, costs), costs)


def _layers_left_out(plan: Plan, costs: Costs) -> int:
    return layers_spared([lobe.own_views or costs.views for lobe in plan.lobes], costs.views)


def _baked(plan: Plan, costs: Costs) -> int:
    """Maps that are baked: one where no lobe needs views."""
    return costs.views if plan.needs_views else 1


def _priced(effect: Effect, plan: Plan, costs: Costs, asked: int) -> Effect:
    seconds: float | None
    size: int | None
    views = _baked(plan, costs)
    whole = views * costs.seconds, _whole_bytes(plan, costs)
    match effect.name:
        case "view_dependence":
            left_out = _layers_bytes(_layers_left_out(plan, costs), costs)
            seconds, size = (costs.views - 1) * costs.seconds, (costs.views - 1) * costs.bytes - left_out
        case "diffuse" | "glossy" | "clear_coat" | "mirror":
            if not effect.on and effect.forced is None:
                return effect  # it is not there: nothing to save
            seconds, size = _of_a_lobe(plan, costs)
        case "lobe_views":
            if not effect.threshold:
                return effect  # no view can do with fewer layers than another
            fewest = layers_spared(own_views(plan.lobes, int(effect.threshold)), costs.views)
            seconds, size = 0.0, _layers_bytes(fewest if effect.on else _layers_left_out(plan, costs), costs)
        case "colour":
            seconds, size = _apart(effect.on, costs, costs.other_colour), _of_colour(costs)
        case "light_sampling":
            seconds, size = _apart(effect.on, costs, costs.other_sampling), 0
        case "resolution":
            # What is on costs what half the resolution would not; what is off saves all beyond its own
            factor = 0.75 if effect.on else (asked / plan.resolution) ** 2 - 1
            seconds, size = factor * whole[0], round(factor * whole[1])
        case "spectral":  # the samples of a map cost more; its size is that of RGB
            seconds, size = _apart(effect.on, costs, costs.other_rendering), 0
        case "polarisation":  # what it costs beyond the spectra that come with it is not told apart
            seconds, size = None, 0
        case _:
            return effect
    return effect.costing(seconds, size)


def _of_a_lobe(plan: Plan, costs: Costs) -> tuple[float | None, int | None]:
    """Keeping a lobe apart takes its layer and its share of the work; the only lobe of a material takes all."""
    if costs.lobes == 1 and not plan.left_out:
        return costs.views * costs.seconds, costs.views * costs.bytes
    apart = _apart(True, costs, costs.one_lobe)
    size = _layers_bytes(costs.views, costs) - _layers_bytes(_layers_left_out(plan, costs), costs) // costs.lobes
    return None if apart is None else apart / max(costs.lobes - 1, 1), size


def _of_colour(costs: Costs) -> int | None:
    """Bytes between one channel and three: few, for where three are the same the files' compression finds it."""
    if costs.other_colour_bytes is None:
        return None
    return costs.views * abs(costs.other_colour_bytes - costs.bytes)


def _layers_bytes(layers: int, costs: Costs) -> int:
    """Bytes of so many layers: channels of noise compress alike."""
    return round(layers * costs.bytes * _RADIANCE / (costs.lobes * _RADIANCE + _VARIANCE + _COVERAGE))


def _apart(is_on: bool, costs: Costs, other: float | None) -> float | None:
    """Seconds over all views that what is on costs, or what is off saves; 0 where noise turned the difference round."""
    if other is None:
        return None
    return costs.views * max(0.0, costs.seconds - other if is_on else other - costs.seconds)
