"""Number of stored views in which each lobe is a layer of its own.

The views of an icosphere are nested: the first 12 are the icosahedron, the first 42 its first subdivision, and so on. A
lobe that needs fewer views than are stored is a layer of its own in the first views only. In the other views such lobes
are added to one layer, so that the sum of all layers is the whole map in every view.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from rsibr.geometry.viewpoints import VIEW_COUNTS
from rsibr.planning.plan import Effect, LobePlan, decided
from rsibr.scene.config import EffectsConfig, ViewsConfig

NAME = "lobe_views"
_UNIT = "views that all lobes but one need at least"


def lobe_views(
    lobes: tuple[LobePlan, ...], views: ViewsConfig, settings: EffectsConfig, mirrors: Collection[str] = ()
) -> tuple[Effect, tuple[LobePlan, ...]]:
    """Decide whether every view stores a layer for each lobe, and if not, how many views do.

    Parameters
    ----------
    lobes : tuple of LobePlan
        The lobes that are stored, with the views that each needs.
    views, settings
        Sections of the config. `effects.lobe_views`: "on", every lobe in every view; "off", no lobe in more than the
        next smaller number of nested views, whatever it needs.
    mirrors : collection of str
        Names of delta lobes. They stay apart in all views: a reconstruction leaves their noisy layer out.

    Returns
    -------
    effect : Effect
        On if every view stores all lobes. It causes no error in the maps: the sum of the layers is the same.
    lobes : tuple of LobePlan
        The same lobes with `LobePlan.own_views` set.
    """
    count = VIEW_COUNTS[views.level]
    fewer = max((smaller for smaller in VIEW_COUNTS if smaller < count), default=0)
    forced, why_on = settings.lobe_views, "each lobe is a layer of its own in all views"
    if alike := _why_all_alike(lobes, views, settings, fewer):
        return decided(NAME, forced, 0.0, 0.0, _UNIT, why_on, alike, error_if_left_out=0.0), lobes
    why_off = "lobes that need fewer views than are stored are one layer, `rest`, in the others"
    needing = [replace(lobe, views_needed=count) if lobe.name in mirrors else lobe for lobe in lobes]
    fewest = float(min(own_views(needing, count)))
    effect = decided(NAME, forced, fewest, float(fewer), _UNIT, why_on, why_off, error_if_left_out=0.0)
    if effect.on:
        return effect, lobes
    own = own_views(needing, fewer if forced == "off" else count)
    return effect, tuple(
        replace(lobe, own_views=number if number < count else None) for lobe, number in zip(lobes, own, strict=True)
    )


def own_views(lobes: Sequence[LobePlan], most: int) -> list[int]:
    """Number of views in which each lobe is a layer of its own: the number it needs, from 12 to `most`.

    The lobe that needs fewest gets as many as the second: a single lobe has no other to be added to.
    """
    needed = [min(max(lobe.views_needed, VIEW_COUNTS[0]), most) for lobe in lobes]
    second = sorted(needed)[1]
    return [max(number, second) for number in needed]


def parts_spared(own: Sequence[int], count: int) -> int:
    """Parts saved in `count` maps, compared with a layer for each lobe and their sum in every map.

    Parameters
    ----------
    own : sequence of int
        Views that store each lobe apart, from `own_views`.
    count : int
        Number of views.
    """
    layers = sum(count - number for number in sorted(own)[1:])
    sums = count - max(own) if len(own) > 1 else 0  # a map of one layer needs no sum
    return layers + sums


def _why_all_alike(lobes: tuple[LobePlan, ...], views: ViewsConfig, settings: EffectsConfig, fewer: int) -> str:
    """Reason why all views have the same layers whatever the lobes need; empty if there is none."""
    if settings.lobes == "off":
        return "lobes are not kept apart"
    if len(lobes) == 1:
        return "there is one lobe: each map has one layer"
    if not any(lobe.maps_needed for lobe in lobes):
        return "one map is baked"
    if views.file is not None:
        return "views from a file are not nested: every view stores all lobes"
    return "" if fewer else f"no lobe is stored in fewer than {VIEW_COUNTS[0]} views"
