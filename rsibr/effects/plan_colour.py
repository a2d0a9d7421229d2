"""Decisions on colour: one channel, three, or the spectrum; and polarisation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rsibr.effects.light_probe import LightProbe
from rsibr.effects.material_probe import MaterialProbe
from rsibr.effects.metamerism import rgb_mismatch
from rsibr.effects.plan import Effect, decided, flagged, number
from rsibr.scene.config import EffectsConfig

GREY = 1e-4
"""Difference between the channels, relative, up to which light and material count as grey: a relMSE of 1e-8."""

JUST_NOTICEABLE = 1.0
"""ΔE_ITP that an observer can just tell (ITU-R BT.2124-0)."""


def colour_effect(material: MaterialProbe, light: LightProbe, settings: EffectsConfig) -> Effect:
    """Whether three channels are rendered; one is enough for grey light on a grey material."""
    chroma = max(light.chroma, material.chroma)
    both = material.chroma**2 + light.chroma**2
    coloured = [name for name, value in (("light", light.chroma), ("material", material.chroma)) if value > GREY]
    return decided(
        "colour", settings.colour, chroma, GREY, "difference between the channels, relative",
        f"the {' and the '.join(coloured)} {'are' if len(coloured) > 1 else 'is'} coloured",
        "grey light on a grey material: one channel is rendered and stored",
        error_if_left_out=min(1.0, both),
    )  # fmt: skip


def spectral_effect(material: Any, emitter: dict[str, Any] | None) -> Effect:
    """Whether RGB stands in for the spectra that the config gives; a bake is always of RGB, so that it is flagged.

    Parameters
    ----------
    material : dict or Path or None
        The BSDF as plain data, or the XML file that holds it.
    emitter : dict or None
        The light as plain data; None for a map, which has no spectra.
    """
    mismatch = rgb_mismatch(material, emitter)
    if mismatch is None:
        return flagged(
            "spectral", 0.0, JUST_NOTICEABLE, "ΔE_ITP of RGB against the spectra", "",
            "no spectra are given: colours are RGB from the start",
        )  # fmt: skip
    effect = flagged(
        "spectral", mismatch.difference, JUST_NOTICEABLE, "ΔE_ITP of RGB against the spectra",
        f"RGB shifts the colour of {mismatch.pigment} under {mismatch.light}, and a bake holds RGB alone",
        f"RGB keeps the colour of {mismatch.pigment} under {mismatch.light}",
    )  # fmt: skip
    return replace(effect, error_if_left_out=mismatch.rel_mse, why=f"{effect.why} (relMSE {number(mismatch.rel_mse)})")


def polarisation_effect() -> Effect:
    """Off, and exact: distant light that is not polarised is reflected once, and its radiance stays what it is."""
    return flagged(
        "polarisation", 0.0, 0.0, "change of radiance", "",
        "one reflection of unpolarised light: radiance is exact without it",
    )  # fmt: skip
