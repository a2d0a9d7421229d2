"""Plan of a bake: the effects that the scene requires, with evidence, cost and the error of leaving each out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from pydantic import ConfigDict

from rsibr.backend import Rendering

Forced = Literal["on", "off"] | None
_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)

NEGLIGIBLE = 1e-5
"""Error (relMSE) that is negligible: below the noise of 1000 samples a texel on a glossy material under a real sky."""


@dataclass(frozen=True)
class Effect:
    """One effect: a part of the simulation that costs time and may not matter in this scene.

    Attributes
    ----------
    name : str
        Name in the section `effects` of a config, where it can be forced.
    on : bool
        Whether the bake simulates it.
    forced : {"on", "off"} or None
        Value forced by the config; None if the evidence decided.
    evidence, threshold : float
        Measured number, and the threshold above which the effect matters.
    unit : str
        Description of the evidence.
    why : str
        The decision in words.
    cost_seconds, cost_bytes
        Cost for the whole bake if on; None if not measured. 0 if off.
    saved_seconds, saved_bytes
        Saving from leaving it out; None if not measured. 0 if on.
    error_if_left_out : float or None
        Estimated relMSE of leaving it out; `rsibr validate` measures it. None if there is no estimate.
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
        """Whether it matters here and is left out: forced off, or not representable by maps."""
        return self.matters and not self.on

    @property
    def left_out(self) -> str:
        """That it is left out although it matters, with the reason, in words."""
        return self.why if self.forced else f"left out, though it matters here: {self.why}"

    def costing(self, seconds: float | None, size: int | None) -> Effect:
        """Return the same effect with its cost, or its saving if it is off [s, bytes]."""
        if self.on:
            return replace(self, cost_seconds=seconds, cost_bytes=size)
        return replace(self, saved_seconds=seconds, saved_bytes=size)


@dataclass(frozen=True)
class LobePlan:
    """Decision on a lobe: whether it needs maps, and from how many views.

    Attributes
    ----------
    name : str
        Name of its layer.
    maps_needed : bool
        Whether maps are needed; otherwise its radiance has a closed form, see `rsibr.planning.lobes`.
    views_needed : int
        Number of stored views at which the estimated interpolation error is small; 0 without maps.
    evidence, threshold : float
        Estimated relMSE of the closed form, and the threshold up to which it is used.
    why : str
        The decision in words.
    own_views : int or None
        Number of views that store it as a layer of its own, the first ones; the others store it added to further lobes.
        None if all views do, and in plans older than this field. See `rsibr.planning.views`.
    fit_angles : tuple of float
        View angles to the normal [°] at which the fit of the lobe was held against the BRDF; empty for a delta lobe and
        in plans older than this field.
    fit_errors : tuple of float
        At each of these angles, the share of the lobe's light that the model gathers from wrong directions, in [0, 1].
        See `rsibr.lobes.fit_error`.
    """

    __pydantic_config__ = _STRICT

    name: str
    maps_needed: bool
    views_needed: int
    evidence: float
    threshold: float
    why: str
    own_views: int | None = None
    fit_angles: tuple[float, ...] = ()
    fit_errors: tuple[float, ...] = ()


@dataclass(frozen=True, repr=False)
class Plan:
    """Decisions on what a bake simulates. Recorded in its manifest.

    Attributes
    ----------
    effects : tuple of Effect
        All effects that were considered.
    lobes : tuple of LobePlan
        Lobes of the material that are simulated, widest first.
    left_out : tuple of str
        Names of the lobes that the config forces off; their light is missing from the maps.
    grey : bool
        Whether one channel is rendered and stored.
    light_samples : bool
        Whether the emitter is sampled besides the BSDF.
    resolution : int
        Texels a side of the maps.
    seconds, bytes
        Cost of the whole bake as planned; None if not measured.
    probe_seconds : float
        Time that measuring the material and the light took.
    costs_from : str
        Origin of the costs, for display.
    environment_notes : tuple of str
        What was converted or left aside when the environment was read, and what looks odd.
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
    environment_notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        on = ", ".join(effect.name for effect in self.effects if effect.on)
        return f"Plan({', '.join(lobe.name for lobe in self.lobes)}; on: {on or 'nothing'})"

    def __getitem__(self, name: str) -> Effect:
        """Return the effect of that name; KeyError if there is none."""
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise KeyError(name)

    @property
    def needs_views(self) -> bool:
        """Whether some lobe has no sufficient closed form and needs maps from several views."""
        return any(lobe.maps_needed for lobe in self.lobes)

    @property
    def rendering(self) -> Rendering:
        """Rendering of the maps: "rgb", "spectral" or "spectral_polarized"."""
        return rendering_of(self.effects)

    @property
    def missed(self) -> tuple[Effect, ...]:
        """Effects that matter here and are left out."""
        return tuple(effect for effect in self.effects if effect.missed)

    def notes(self) -> Iterator[str]:
        """One sentence for each peculiarity of the environment, and for each effect that matters and is left out."""
        yield from self.environment_notes
        for effect in self.missed:
            yield f"{effect.name}: {effect.left_out} ({effect.unit}: {number(effect.evidence)})"


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
    """Decide by the evidence, unless the config forces the decision.

    Parameters
    ----------
    name, evidence, threshold, unit, error_if_left_out
        See `Effect`.
    forced : str
        "auto", "on" or "off".
    why_on, why_off : str
        Reason for either decision.

    Returns
    -------
    Effect
        Without its costs.
    """
    by_evidence = evidence > threshold
    on = by_evidence if forced == "auto" else forced == "on"
    why = why_on if by_evidence else why_off
    if on != by_evidence:
        why = f"turned {forced}, though it {'matters' if by_evidence else 'hardly matters'} here: {why}"
    insisted: Forced = None if forced == "auto" else "on" if on else "off"
    return Effect(name, on, insisted, evidence, threshold, unit, why, error_if_left_out=error_if_left_out)


def flagged(name: str, evidence: float, threshold: float, unit: str, why: str, why_not: str) -> Effect:
    """Make an effect that maps cannot represent: measured, never on."""
    matters = evidence > threshold
    return Effect(
        name, False, None, evidence, threshold, unit, why if matters else why_not,
        error_if_left_out=None if matters else 0.0,
    )  # fmt: skip


def rendering_of(effects: Iterable[Effect]) -> Rendering:
    """Rendering that follows from the effects; "rgb" if none concerns it."""
    on = {effect.name for effect in effects if effect.on}
    if "polarisation" in on:
        return "spectral_polarized"
    return "spectral" if "spectral" in on else "rgb"


def number(value: float) -> str:
    """Format a number for display, with three significant digits."""
    return "0" if value == 0 else f"{value:.3g}"


def unique(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Collect effects in a tuple; ValueError if two share a name."""
    found = tuple(effects)
    if len({effect.name for effect in found}) != len(found):
        raise ValueError("two effects share a name")
    return found
