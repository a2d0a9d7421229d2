"""Decisions on colour: one channel, RGB or spectra; and on polarisation.

Spectral and polarised rendering follow from the config alone, so that a bake, its reference and a study agree without
measuring the scene.
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
"""Relative difference between the channels up to which light and material count as grey: a relMSE of 1e-8."""

JUST_NOTICEABLE = 1.0
"""Just noticeable ΔE_ITP (ITU-R BT.2124-0)."""

POLARISING = ("polarizer", "retarder", "circular", "measured_polarized")
"""Mitsuba plugins whose only effect is on polarisation."""

_MISMATCH = "ΔE_ITP of RGB against the spectra"


@dataclass(frozen=True)
class ColourEffects:
    """Decisions on spectra and polarisation.

    Attributes
    ----------
    spectral, polarisation : Effect
        The two decisions.
    one_spectrum : bool
        Whether the light is constant over the sphere, so that each lobe has one colour under it.
    """

    spectral: Effect
    polarisation: Effect
    one_spectrum: bool

    @classmethod
    def of(cls, config: Config) -> ColourEffects:
        """Decide from the spectra, the polarising plugins and the switches of a config."""
        material, emitter = _given(config)
        polarisation = polarisation_effect(material, config.effects)
        spectral = spectral_effect(material, emitter, config.effects, polarisation.on)
        return cls(spectral, polarisation, (emitter or {}).get("type") == "constant")

    @property
    def rendering(self) -> Rendering:
        """Rendering that follows from the decisions: selects the variant of Mitsuba."""
        return rendering_of((self.spectral, self.polarisation))

    @property
    def breaks_closed_forms(self) -> bool:
        """Whether closed forms, which multiply RGB values, are invalid: spectra that vary over the sky."""
        return self.rendering != "rgb" and not self.one_spectrum


def colour_effect(material: MaterialProbe, light: LightProbe, settings: EffectsConfig, spectral: bool) -> Effect:
    """Decide whether three channels are rendered; one suffices for grey light on a grey material, both in RGB.

    Parameters
    ----------
    material, light
        Measurements of the scene.
    settings : EffectsConfig
        Section of the config that may force the decision.
    spectral : bool
        Whether the bake is spectral.
    """
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
    """Decide whether light and material are rendered spectrally, or their spectra converted to RGB.

    Parameters
    ----------
    material : mapping or Path or None
        BSDF as plain data, or path of its XML file.
    emitter : mapping or None
        Emitter as plain data; None for an image, which has no spectra.
    settings : EffectsConfig
        Section of the config that may force the decision.
    polarised : bool
        Whether polarisation is rendered, for which Mitsuba has spectral variants only.
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
    """Decide whether Mueller matrices are rendered: on request, or if the material has a polarising plugin.

    Without them radiance is exact: Mitsuba's emitters are unpolarised, and distant light is reflected once.
    """
    found = sorted({name for name in _plugins(material) if name in POLARISING})
    exact = "one reflection of unpolarised light: radiance is exact without it"
    return decided(
        "polarisation", settings.polarisation, float(len(found)), 0.0, "polarising parts of the material",
        f"the material has {', '.join(found)}", exact, error_if_left_out=None if found else 0.0,
    )  # fmt: skip


def _plugins(source: Mapping[str, Any] | Path | None) -> Iterator[str]:
    """Type names of all plugins in a material."""
    if isinstance(source, Path):
        yield from (element.get("type", "") for element in ElementTree.parse(source).getroot().iter())
        return
    for key, value in (source or {}).items():
        if isinstance(value, Mapping):
            yield from _plugins(value)
        elif key == "type":
            yield str(value)


def _given(config: Config) -> tuple[dict[str, Any] | Path | None, dict[str, Any] | None]:
    """Material and emitter of a config, as plain data or XML that may contain spectra."""
    material = config.material
    file = material.file if material.file is not None and material.file.suffix == ".xml" else None
    return material.bsdf or file, config.environment.emitter
