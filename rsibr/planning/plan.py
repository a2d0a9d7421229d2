"""The plan: which effects a scene calls for, with the evidence, the cost and what leaving each out would do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from pydantic import ConfigDict

from rsibr.backend import Rendering

Forced = Literal["on", "off"] | None
_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)

NEGLIGIBLE = 1e-5
"""Error (relMSE) that no one misses: below the noise of 1000 samples a texel on a glossy material under a real sky."""


@dataclass(frozen=True)
class Effect:
    """One effect: something that costs time and may not matter here.

    Attributes
    ----------
    name : str
        As the section `effects` of a config calls it, where it can be forced.
    on : bool
        Whether the bake simulates it.
    forced : {"on", "off"} or None
        What the config insists on; None where the evidence decided.
    evidence, threshold : float
        The measured number; above the threshold the effect matters.
    unit : str
        What the evidence is.
    why : str
        The decision in words.
    cost_seconds, cost_bytes
        What it costs the whole bake if on; None where that was not measured. 0 if off.
    saved_seconds, saved_bytes
        What leaving it out saves; None where that was not measured. 0 if on.
    error_if_left_out : float or None
        relMSE that leaving it out would make, estimated; `rsibr validate` measures it. None where it has no estimate.
    """

    __pydantic_config__ = _STRICT

    name: str
    on: bool
    forced: Forced
    evidence: float
    threshold: float
    unit: str
    why: str
    cost_seconds: float | None = 0.0
    cost_bytes: int | None = 0
    saved_seconds: float | None = 0.0
    saved_bytes: int | None = 0
    error_if_left_out: float | None = 0.0

    @property
    def matters(self) -> bool:
        """Whether the evidence is above the threshold."""
        return self.evidence > self.threshold

    @property
    def missed(self) -> bool:
        """Whether it matters here and is left out: by force, or because maps cannot hold it."""
        return self.matters and not self.on

    def costing(self, seconds: float | None, size: int | None) -> Effect:
        """Return the same effect with what it costs, or saves where it is off [s, bytes]."""
        if self.on:
            return replace(self, cost_seconds=seconds, cost_bytes=size)
        return replace(self, saved_seconds=seconds, saved_bytes=size)


@dataclass(frozen=True)
class LobePlan:
    """Whether a lobe needs maps of its own, and from how many views.

    Attributes
    ----------
    name : str
        Name of its layer.
    maps_needed : bool
        Whether maps are needed at all; without, its radiance has a closed form: see `rsibr.planning.lobes`.
    views_needed : int
        Stored views from which on interpolation errs negligibly, by the estimate; 0 without maps.
    evidence, threshold : float
        relMSE of the closed form, estimated, and the threshold below which it serves.
    why : str
        The decision in words.
    own_views : int or None
        The first so many views store it as a layer of its own, the others added to further lobes; None where all views
        do, and in plans older than this field. See `rsibr.planning.views`.
    """

    __pydantic_config__ = _STRICT

    name: str
    maps_needed: bool
    views_needed: int
    evidence: float
    threshold: float
    why: str
    own_views: int | None = None


@dataclass(frozen=True)
class Plan:
    """What a bake simulates. Recorded in its manifest.

    Attributes
    ----------
    effects : tuple of Effect
        All that were looked at.
    lobes : tuple of LobePlan
        Each lobe of the material that is not left out, widest first.
    left_out : tuple of str
        Names of the lobes that the config forces off: their light is missing from the maps.
    grey : bool
        Whether one channel is rendered and stored.
    light_samples : bool
        Whether directions are drawn from the light beside those from the BSDF.
    resolution : int
        Texels a side of the maps.
    seconds, bytes
        Of the whole bake as planned; None where not measured.
    probe_seconds : float
        Time that looking at the material and the light took.
    costs_from : str
        Where the costs come from.
    """

    __pydantic_config__ = _STRICT

    effects: tuple[Effect, ...]
    lobes: tuple[LobePlan, ...]
    left_out: tuple[str, ...]
    grey: bool
    light_samples: bool
    resolution: int
    seconds: float | None
    bytes: int | None
    probe_seconds: float
    costs_from: str

    def __getitem__(self, name: str) -> Effect:
        """Return the effect of that name; KeyError where there is none."""
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise KeyError(name)

    @property
    def needs_views(self) -> bool:
        """Whether some lobe needs maps from several views, having no closed form that is good enough."""
        return any(lobe.maps_needed for lobe in self.lobes)

    @property
    def rendering(self) -> Rendering:
        """What is carried along a path."""
        return rendering_of(self.effects)

    @property
    def missed(self) -> tuple[Effect, ...]:
        """Effects that matter here and are left out."""
        return tuple(effect for effect in self.effects if effect.missed)

    def notes(self) -> Iterator[str]:
        """One sentence for each effect that matters and is left out."""
        for effect in self.missed:
            yield f"{effect.name} matters here and is left out ({number(effect.evidence)} {effect.unit}): {effect.why}"


def decided(
    name: str,
    forced: str,
    evidence: float,
    threshold: float,
    unit: str,
    why_on: str,
    why_off: str,
    error_if_left_out: float | None = None,
) -> Effect:
    """Decide by the evidence, unless the config insists.

    Parameters
    ----------
    name, evidence, threshold, unit, error_if_left_out
        See `Effect`.
    forced : str
        "auto", "on" or "off".
    why_on, why_off : str
        The decision in words, either way.

    Returns
    -------
    Effect
        Without its costs.
    """
    by_evidence = evidence > threshold
    on = by_evidence if forced == "auto" else forced == "on"
    why = why_on if by_evidence else why_off
    if on != by_evidence:
        why = f"forced {forced}, against the evidence: {why}"
    insisted: Forced = None if forced == "auto" else "on" if on else "off"
    return Effect(name, on, insisted, evidence, threshold, unit, why, error_if_left_out=error_if_left_out)


def flagged(name: str, evidence: float, threshold: float, unit: str, why: str, why_not: str) -> Effect:
    """Make an effect that maps cannot hold: looked for, never on."""
    matters = evidence > threshold
    return Effect(
        name, False, None, evidence, threshold, unit, why if matters else why_not,
        error_if_left_out=None if matters else 0.0,
    )  # fmt: skip


def rendering_of(effects: Iterable[Effect]) -> Rendering:
    """What is carried along a path where these effects are decided so; RGB where nothing is said of it."""
    on = {effect.name for effect in effects if effect.on}
    if "polarisation" in on:
        return "spectral_polarized"
    return "spectral" if "spectral" in on else "rgb"


def number(value: float) -> str:
    """Write a number of a plan for a person."""
    return "0" if value == 0 else f"{value:.3g}"


def unique(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Put effects into a tuple; ValueError where two share a name."""
    found = tuple(effects)
    if len({effect.name for effect in found}) != len(found):
        raise ValueError("two effects share a name")
    return found
