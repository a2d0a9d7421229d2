"""Decisions on colour: one channel, three, or the spectrum; and polarisation.

What is rendered in spectra or with polarisation follows from the config alone, so that a bake, its reference and a
study agree on it without probing anything.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from rsibr.backend import Rendering
from rsibr.light.probe import LightProbe
from rsibr.planning.material_probe import MaterialProbe
from rsibr.planning.metamerism import rgb_mismatch
from rsibr.planning.plan import Effect, decided, number, rendering_of
from rsibr.scene.config import Config, EffectsConfig

GREY = 1e-4
"""Difference between the channels, relative, up to which light and material count as grey: a relMSE of 1e-8."""

JUST_NOTICEABLE = 1.0
"""ΔE_ITP that an observer can just tell (ITU-R BT.2124-0)."""


POLARISING = ("polarizer", "retarder", "circular", "measured_polarized")
"""Plugins of Mitsuba that are there for nothing but polarisation."""

_MISMATCH = "ΔE_ITP of RGB against the spectra"


@dataclass(frozen=True)
class ColourEffects:
    """What is carried along a path, decided.

    Attributes
    ----------
    spectral, polarisation : Effect
    one_spectrum : bool
        Whether the light is the same from everywhere, so that a lobe has one colour under it.
    """

    spectral: Effect
    polarisation: Effect
    one_spectrum: bool

    @classmethod
    def of(cls, config: Config) -> ColourEffects:
        """Decide by what the config gives: its spectra, its polarising parts, its switches."""
        material, emitter = _given(config)
        polarisation = polarisation_effect(material, config.effects)
        spectral = spectral_effect(material, emitter, config.effects, polarisation.on)
        return cls(spectral, polarisation, (emitter or {}).get("type") == "constant")

    @property
    def rendering(self) -> Rendering:
        """Which variants of Mitsuba carry it out."""
        return rendering_of((self.spectral, self.polarisation))

    @property
    def breaks_closed_forms(self) -> bool:
        """Whether products of RGB, as closed forms are, miss what is rendered: spectra that vary over the sky."""
        return self.rendering != "rgb" and not self.one_spectrum


def colour_effect(material: MaterialProbe, light: LightProbe, settings: EffectsConfig, spectral: bool) -> Effect:
    """Whether three channels are rendered; one is enough for grey light on a grey material, both of them in RGB."""
    chroma = max(light.chroma, material.chroma)
    both = material.chroma**2 + light.chroma**2
    coloured = [name for name, value in (("light", light.chroma), ("material", material.chroma)) if value > GREY]
    effect = decided(
        "colour", settings.colour, chroma, GREY, "difference between the channels, relative",
        f"the {' and the '.join(coloured)} {'are' if len(coloured) > 1 else 'is'} coloured",
        "grey light on a grey material: one channel is rendered and stored",
        error_if_left_out=min(1.0, both),
    )  # fmt: skip
    if spectral and not effect.on and effect.forced is None:
        return replace(effect, on=True, why="grey in RGB, which says nothing of spectra")
    return effect


def spectral_effect(
    material: Mapping[str, Any] | Path | None,
    emitter: Mapping[str, Any] | None,
    settings: EffectsConfig,
    polarised: bool = False,
) -> Effect:
    """Whether light and material are rendered in spectra, or RGB stands in for those that the config gives.

    Parameters
    ----------
    material : mapping or Path or None
        The BSDF as plain data, or the XML file that holds it.
    emitter : mapping or None
        The light as plain data; None for a map, which has no spectra.
    settings : EffectsConfig
        May force it.
    polarised : bool
        Whether polarisation is rendered, which Mitsuba does in spectra alone.
    """
    mismatch = rgb_mismatch(material, emitter)
    if mismatch is None:
        why = "no spectra are given: colours are RGB from the start"
        effect = decided("spectral", settings.spectral, 0.0, JUST_NOTICEABLE, _MISMATCH, why, why, 0.0)
    else:
        where = f"the colour of {mismatch.pigment} under {mismatch.light}"
        effect = decided(
            "spectral", settings.spectral, mismatch.difference, JUST_NOTICEABLE, _MISMATCH,
            f"RGB shifts {where} (relMSE {number(mismatch.rel_mse)})",
            f"RGB keeps {where} (relMSE {number(mismatch.rel_mse)})",
            error_if_left_out=mismatch.rel_mse,
        )  # fmt: skip
    if polarised and not effect.on:
        return replace(effect, on=True, why=f"with polarisation, which Mitsuba has in spectra alone; {effect.why}")
    return effect


def polarisation_effect(material: Mapping[str, Any] | Path | None, settings: EffectsConfig) -> Effect:
    """Whether Mueller matrices are rendered: on request, or where the material has a polarising part.

    Without it radiance is exact: distant light of Mitsuba's emitters is not polarised, and it is reflected once.
    """
    found = sorted({name for name in _plugins(material) if name in POLARISING})
    exact = "one reflection of unpolarised light: radiance is exact without it"
    return decided(
        "polarisation", settings.polarisation, float(len(found)), 0.0, "polarising parts of the material",
        f"the material has {', '.join(found)}", exact, error_if_left_out=None if found else 0.0,
    )  # fmt: skip


def _plugins(source: Mapping[str, Any] | Path | None) -> Iterator[str]:
    """Types of all plugins of a material."""
    if isinstance(source, Path):
        yield from (element.get("type", "") for element in ElementTree.parse(source).getroot().iter())
        return
    for key, value in (source or {}).items():
        if isinstance(value, Mapping):
            yield from _plugins(value)
        elif key == "type":
            yield str(value)


def _given(config: Config) -> tuple[dict[str, Any] | Path | None, dict[str, Any] | None]:
    """What the config gives as plain data or XML, where spectra may stand."""
    material = config.material
    file = material.file if material.file is not None and material.file.suffix == ".xml" else None
    return material.bsdf or file, config.environment.emitter
