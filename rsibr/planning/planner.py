"""Measurement of a scene, and the plan that follows from it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import mitsuba as mi

from rsibr.errors import InputError
from rsibr.light.probe import LightProbe, probe_light
from rsibr.lobes.split import LobeSplit
from rsibr.planning.colour import ColourEffects, colour_effect
from rsibr.planning.fit import unfitted, with_fit_errors
from rsibr.planning.flags import flag_effects, use_effects
from rsibr.planning.light import Resolution, is_even, resolution_effect, sampling_effect
from rsibr.planning.lobes import Weights, effect_of, fresnel_effect, lobe_effects, lobe_maps, view_effect
from rsibr.planning.maps import left_out_errors
from rsibr.planning.material_probe import LobeProbe, MaterialProbe, probe_material
from rsibr.planning.plan import Effect, Plan, unique
from rsibr.planning.views import lobe_views
from rsibr.scene.config import Config
from rsibr.scene.environment import Environment

NOT_MEASURED = "not measured"


@dataclass(frozen=True, eq=False)
class Probes:
    """Measurements that a plan is based on.

    Attributes
    ----------
    light : LightProbe
        Statistics of the environment.
    material : MaterialProbe
        Measurements of the material.
    split : LobeSplit
        The material's lobes.
    seconds : float
        Time that the measurements took.
    """

    light: LightProbe
    material: MaterialProbe
    split: LobeSplit
    seconds: float

    @property
    def wants_pilot(self) -> bool:
        """Whether emitter sampling must be decided by a pilot: an even sky, and a lobe that is not a delta lobe."""
        glossy_or_matte = any(lobe.kind != "mirror" for lobe in self.material.lobes)
        return is_even(self.light) and glossy_or_matte and not self.light.is_black


def probe_scene(environment: Environment, bsdf: mi.BSDF, split: LobeSplit | None = None) -> Probes:
    """Measure the material and the light.

    Parameters
    ----------
    environment : Environment
        Environment of the scene.
    bsdf : mi.BSDF
    split : LobeSplit, optional
        Of the BSDF, where it is known already; by default it is fitted here.

    Returns
    -------
    Probes
    """
    start = time.perf_counter()
    split = split or LobeSplit.of(bsdf)
    material = probe_material(bsdf, split)
    light = probe_light(environment.emitter(), environment.image)
    return Probes(light, material, split, time.perf_counter() - start)


def make_plan(config: Config, probes: Probes, sampling_ratio: float | None) -> Plan:
    """Decide on every effect.

    Parameters
    ----------
    config : Config
        Config of the bake; its section `effects` may force decisions.
    probes : Probes
        From `probe_scene`.
    sampling_ratio : float or None
        Variance of BSDF sampling alone over that of both; None unless `Probes.wants_pilot`.

    Returns
    -------
    Plan
        The decisions without their costs; for these see `rsibr.planning.costs`.

    Raises
    ------
    InputError
        If the config forces all lobes off, or if no lobe reflects the light.
    """
    # Modelled error of leaving out each lobe
    start = time.perf_counter()
    settings, light, material = config.effects, probes.light, probes.material
    errors = left_out_errors(probes.split.lobes, material.lobes, light)
    left_out = {lobe.name: error for lobe, error in zip(material.lobes, errors, strict=True)}
    asked = Resolution(config.map.side, explicit=config.map.resolution != "auto")
    full, resolution = resolution_effect(probes.split.lobes, material.lobes, light, asked, settings)
    spectra = ColourEffects.of(config)
    colour = colour_effect(material, light, settings, spectra.rendering != "rgb")
    sampling = sampling_effect(light, material, sampling_ratio, settings, config.sampling)
    # Lobes, and the views that store them
    of_material = tuple(_of_the_material(config, probes, left_out, spectra.breaks_closed_forms))
    carried = (colour, spectra.spectral, spectra.polarisation)
    kept, dropped = _kept(material, of_material)
    _check_seen(kept, light)
    lobes = tuple(
        lobe_maps(lobe, left_out[lobe.name], light, settings.view_dependence, spectra.breaks_closed_forms)
        for lobe in kept
    )
    layers, lobes = lobe_views(lobes, config.views, settings, [lobe.name for lobe in kept if lobe.kind == "mirror"])
    flags = (*flag_effects(material), unfitted(material), *use_effects())
    return Plan(
        effects=unique([*of_material, layers, *carried, sampling, full, *flags]),
        lobes=with_fit_errors(lobes, material),
        left_out=dropped,
        grey=not colour.on,
        light_samples=sampling.on,
        resolution=resolution,
        seconds=None,
        bytes=None,
        probe_seconds=max(probes.seconds + time.perf_counter() - start, 0.0),  # a clock may jump back
        costs_from=NOT_MEASURED,
    )


def _of_the_material(config: Config, probes: Probes, left_out: Weights, no_closed_form: bool) -> Iterator[Effect]:
    yield view_effect(probes.material, left_out, probes.light, config.effects, no_closed_form)
    yield from lobe_effects(probes.material, left_out, config.effects)
    yield fresnel_effect(probes.material, config.effects)


def _kept(material: MaterialProbe, effects: tuple[Effect, ...]) -> tuple[list[LobeProbe], tuple[str, ...]]:
    """Lobes that are simulated, and the names of the others."""
    off = {effect.name for effect in effects if effect.forced == "off"}
    kept = [lobe for lobe in material.lobes if effect_of(lobe, material.lobes) not in off]
    if not kept:
        raise InputError(
            f"nothing is left to bake: the material is only {', '.join(lobe.name for lobe in material.lobes)}",
            where="effects",
            fix='leave one of its lobes at "auto"',
        )
    return kept, tuple(lobe.name for lobe in material.lobes if lobe not in kept)


def _check_seen(lobes: list[LobeProbe], light: LightProbe) -> None:
    """Raise if all light is without extent and all lobes are perfect mirrors: no sample ever hits one in the other."""
    if light.is_delta and all(lobe.kind == "mirror" for lobe in lobes):
        raise InputError(
            "a light without extent is not seen in a perfect mirror: every map would be black",
            where="environment and material",
            fix="use a light with an extent, such as an envmap or sunsky, or a material with some roughness",
        )
