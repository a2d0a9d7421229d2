"""Faults of single maps of a capture: upside down or mirrored, misexposed, mis-posed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rsibr.store.map_file import MapFile
from rsibr.validation.health.photographs.exposures import exposures
from rsibr.validation.health.photographs.observed import Common, Observed, logarithms, observed
from rsibr.validation.health.photographs.registration import Agreement, correlation, of_the_others, registered
from rsibr.validation.health.photographs.sphere_grid import grids

Array = NDArray[np.float64]
Fault = Literal["orientation", "exposure", "pose", "content"]

LEAST_VIEWS = 6
"""Views below which no photograph is judged by the others."""

STOPS = 0.5
"""Exposure against the others beyond which a map is misexposed; that of no sound one in the closed loop exceeds .3."""

DEGREES, ERRORS, TYPICAL = 1.3, 8.0, 2.5
"""A map is mis-posed if a rotation by more degrees than these would make it agree with the others, by more of its
standard errors than these, and by more times the median of all maps: rough paint biases them all."""

ALIKE = 0.4
"""Median correlation of the maps with the others below which poses cannot be judged: too little detail."""

TOLD = 2.0
"""Rotation [degrees] of a pose that should be found; where the limits above exceed it, that is said."""

_BETTER = 0.25  # of the correlation, by which another orientation must fit better
_DOUBTED = 0.75  # times the median correlation, below which other orientations are tried
_STRANGE = 0.5  # times the median correlation, below which a map shows something else

_NAMED = 6  # maps that a note names

_TURNS: dict[str, Array] = {
    "upside down": -np.eye(2),
    "mirrored left to right": np.diag([-1.0, 1.0]),
    "mirrored top to bottom": np.diag([1.0, -1.0]),
    "turned by a quarter": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "turned back by a quarter": np.array([[0.0, 1.0], [-1.0, 0.0]]),
}


@dataclass(frozen=True)
class Suspect:
    """Map that does not fit the others.

    Attributes
    ----------
    view : int
        Index of the stored view.
    name : str
        Its photograph.
    fault : {"orientation", "exposure", "pose", "content"}
    what : str
        In words.
    value : float
        Stops, degrees, or correlation with the others.
    """

    view: int
    name: str
    fault: Fault
    what: str
    value: float


@dataclass(frozen=True)
class Judgement:
    """Result of `judged`.

    Attributes
    ----------
    suspects : tuple of Suspect
    note : str
        What could not be judged, and why; empty if everything was.
    """

    suspects: tuple[Suspect, ...]
    note: str


def judged(maps: Sequence[MapFile], names: Sequence[str], common: Common) -> Judgement:
    """Hold each map against all others.

    Parameters
    ----------
    maps : sequence of MapFile
        Maps of a capture.
    names : sequence of str
        Of their photographs.
    common : {"reflection", "normal"}
        What views share: the mirror direction, or the normal.

    Returns
    -------
    Judgement

    Notes
    -----
    The limits were set on photographs that Mitsuba took of ten paints under four skies, from 12 to 16 directions, 10 to
    50 radii away: so that none of the sound ones was accused, and each that was upside down or misexposed by a stop was
    found. A pose that is off by 2° is found less surely of a clear coat over a matte base and of rough metal,
    whose maps look alike over larger angles; where it would not be, the note says so. The error of novel views does
    not see these faults.
    """
    if len(maps) < LEAST_VIEWS:
        return Judgement((), f"photographs are judged by the others from {LEAST_VIEWS} on; there are {len(maps)}")
    images = logarithms(maps)
    whole = observed(images, maps, common, detail=False)
    stops = exposures(whole, common)
    level = replace(whole, values=whole.values - stops[:, None] * np.log(2))
    seen = level if common == "normal" else observed(images, maps, common, detail=True)
    agreements = [registered(seen, view) for view in range(len(maps))]
    suspects = list(_misexposed(stops, names))
    typical = float(np.median([one.correlation for one in agreements]))
    if typical < ALIKE:
        note = f"poses were not judged: the maps have too little detail in common (correlation {typical:.2f})"
        return Judgement(tuple(suspects), note)
    turned = _wrongly_turned(seen, images, maps, names, common, agreements)
    accused = {one.view for one in turned}
    moved = [one for one in _misposed(agreements, names, typical) if one.view not in accused]
    found = sorted([*suspects, *turned, *moved], key=lambda one: one.view)
    return Judgement(tuple(found), _untold(agreements, {one.view for one in found}, names))


def _misexposed(stops: Array, names: Sequence[str]) -> list[Suspect]:
    return [
        Suspect(k, names[k], "exposure", f"exposed {stops[k]:+.2f} stops against the others", float(stops[k]))
        for k in np.flatnonzero(np.abs(stops) > STOPS).tolist()
    ]


def _wrongly_turned(
    seen: Observed,
    images: Sequence[Array],
    maps: Sequence[MapFile],
    names: Sequence[str],
    common: Common,
    agreements: Sequence[Agreement],
) -> list[Suspect]:
    """Maps that would fit the others much better upside down, or mirrored; asked of those that fit badly."""
    areas = grids()[0].areas
    typical = float(np.median([one.correlation for one in agreements]))
    doubted = [view for view, one in enumerate(agreements) if one.correlation < _DOUBTED * typical]
    best = dict.fromkeys(doubted, ("", -1.0))
    fields = {view: of_the_others(seen, view) for view in doubted}
    for name, turn in _TURNS.items() if doubted else ():
        some = [images[view] for view in doubted], [maps[view] for view in doubted]
        other = observed(*some, common, detail=common == "reflection", turn=turn)
        for place, view in enumerate(doubted):
            field, shown = fields[view]
            use = other.known[place] & shown
            alike = correlation(other.values[place, use], field[use], areas[use])
            best[view] = max(best[view], (name, alike), key=lambda pair: pair[1])
    return [
        Suspect(view, names[view], "orientation", f"fits the others {how}", alike)
        for view, (how, alike) in best.items()
        if alike > agreements[view].correlation + _BETTER
    ]


def _misposed(agreements: Sequence[Agreement], names: Sequence[str], typical: float) -> list[Suspect]:
    limits = _limits(agreements)
    found = []
    for view, (one, limit) in enumerate(zip(agreements, limits, strict=True)):
        if one.degrees > limit:
            what = f"fits the others rotated by {one.degrees:.1f}°: its pose is wrong"
            found.append(Suspect(view, names[view], "pose", what, one.degrees))
        elif one.correlation < _STRANGE * typical:
            what = f"shows something else than the others (correlation {one.correlation:.2f})"
            found.append(Suspect(view, names[view], "content", what, one.correlation))
    return found


def _limits(agreements: Sequence[Agreement]) -> list[float]:
    """Rotation [degrees] of each map beyond which its pose is wrong."""
    usual = float(np.median([one.degrees for one in agreements]))
    return [max(DEGREES, TYPICAL * usual, ERRORS * one.error) for one in agreements]


def _untold(agreements: Sequence[Agreement], accused: set[int], names: Sequence[str]) -> str:
    """Note on the maps, among those not accused, of which a pose that is off by `TOLD` would not be told."""
    limits = {view: limit for view, limit in enumerate(_limits(agreements)) if view not in accused and limit > TOLD}
    if not limits:
        return ""
    least = min(limits.values())
    if len(limits) + len(accused) == len(agreements):
        beyond = f"; only from {least:.1f}° on" if np.isfinite(least) else ""
        return f"poses that are off by {TOLD:g}° cannot be told: too little detail agrees{beyond}"
    shown = ", ".join(names[view] for view in list(limits)[:_NAMED])
    more = f" and {len(limits) - _NAMED} more" if len(limits) > _NAMED else ""
    return f"a pose off by {TOLD:g}° cannot be told of {shown}{more}: too little detail agrees with the others"
