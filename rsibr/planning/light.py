"""Decisions on emitter sampling and on the resolution of the maps."""

from __future__ import annotations

from dataclasses import dataclass

from rsibr.errors import InputError
from rsibr.light.probe import SMALL, UNRESOLVED, LightProbe
from rsibr.lobes.split import Lobe
from rsibr.planning.material_probe import LobeProbe, MaterialProbe
from rsibr.planning.plan import NEGLIGIBLE, Effect, decided, number
from rsibr.planning.resolution import LEAST_RESOLUTION, sufficient_resolution
from rsibr.scene.config import EffectsConfig, SamplingConfig

EVEN = 0.5
"""Relative variance of the radiance up to which the environment counts as even: BSDF sampling misses no source."""

NO_NOISIER = 1.0
"""Variance of BSDF sampling alone, over that of both, up to which emitter sampling does not pay."""


@dataclass(frozen=True)
class Resolution:
    """Texels a side of the maps.

    Attributes
    ----------
    asked : int
        Value of the config, or its default.
    explicit : bool
        Whether the config says so, not "auto": then nothing but `effects.resolution = "off"` lowers it.
    """

    asked: int
    explicit: bool


def is_even(light: LightProbe) -> bool:
    """Whether the environment is so even that BSDF sampling alone may have less variance."""
    return light.variance <= EVEN


def sampling_effect(
    light: LightProbe,
    material: MaterialProbe,
    sampling_ratio: float | None,
    settings: EffectsConfig,
    sampling: SamplingConfig,
) -> Effect:
    """Decide whether the emitter is sampled besides the BSDF, which a sun or a lamp requires.

    Parameters
    ----------
    light, material
        Measurements of the scene.
    sampling_ratio : float or None
        Measured variance of BSDF sampling alone over that of both; None under an uneven sky, where a pilot that misses
        the sun would give a wrong ratio.
    settings : EffectsConfig
        Section of the config that may force the decision.
    sampling : SamplingConfig
        Its `clamp` darkens small sources; its `samples` set the noise without emitter sampling.

    Raises
    ------
    InputError
        If it is forced off under a source without extent, which only emitter sampling can hit.
    """
    if settings.light_sampling == "off" and light.variance == UNRESOLVED:
        raise InputError(
            "'off' would leave out the whole light: no sample of the BSDF hits a source without extent",
            where="effects.light_sampling",
            fix='leave it at "auto"',
        )
    policy = "light and BSDF are both sampled, with the MIS weights of the balance heuristic; nothing is clamped"
    if sampling.clamp is not None:
        policy = (
            f"light and BSDF are both sampled; samples above {sampling.clamp:g} are clamped as asked: too dark maps"
        )
    share = f"{number(100 * light.peak_share)} % of the light from the brightest {100 * SMALL:g} % of the sphere"
    evidence, threshold, unit = light.variance, EVEN, "relative variance of the radiance"
    why_on, why_off = f"a sun or lamps, {share}: {policy}", "there is no light"
    if all(lobe.kind == "mirror" for lobe in material.lobes):
        evidence, why_off = 0.0, "a delta lobe has value zero at every direction sampled from the light"
    elif sampling_ratio is not None:
        evidence, threshold, unit = sampling_ratio, NO_NOISIER, "variance of BSDF sampling alone, over that of both"
        why_on = f"the sky is even, but the light's samples lower the noise: {policy}"
        even = f"relative variance of the radiance {number(light.variance)}"
        why_off = f"the sky is even ({even}): the BSDF's samples alone are no noisier"
    return decided(
        "light_sampling", settings.light_sampling, evidence, threshold, unit, why_on, why_off,
        # No bias, but noise: that of as many samples of a mirror that is smeared over the whole sky
        error_if_left_out=min(1.0, light.variance / sampling.count) if evidence > threshold else 0.0,
    )  # fmt: skip


def resolution_effect(
    lobes: list[Lobe], probes: tuple[LobeProbe, ...], light: LightProbe, resolution: Resolution, settings: EffectsConfig
) -> tuple[Effect, int]:
    """Decide whether the maps need their full resolution.

    Parameters
    ----------
    lobes, probes : Lobe, LobeProbe
        The lobes of the material, in the same order.
    light : LightProbe
        Measurements of the environment.
    resolution : Resolution
        Texels a side in the config.
    settings : EffectsConfig
        Section of the config that may force the decision.

    Returns
    -------
    effect : Effect
        On if the maps keep their full resolution.
    resolution : int
        Texels a side of the bake.
    """
    asked, half = resolution.asked, max(LEAST_RESOLUTION, resolution.asked // 2)
    if half >= asked:
        forced = "on" if settings.resolution == "on" else "auto"
        why = f"maps of {asked}² are not lowered"
        return decided("resolution", forced, 1.0, NEGLIGIBLE, "relMSE of a map of one texel", why, ""), asked
    lower, error = sufficient_resolution(lobes, probes, light, asked, NEGLIGIBLE)
    unit = f"relMSE of a map of {min(lower, half)}², by a model of it"
    if settings.resolution == "auto" and resolution.explicit and lower < asked:
        why = f"{lower}² texels would do, but the config asks for {asked}²"
        return Effect("resolution", True, None, error, NEGLIGIBLE, unit, why, error_if_left_out=error), asked
    effect = decided(
        "resolution", settings.resolution, min(error, 1.0), NEGLIGIBLE, unit,
        f"maps of {half}² would be too coarse", f"maps of {lower}² resolve this light",
        error_if_left_out=min(error, 1.0),
    )  # fmt: skip
    return effect, asked if effect.on else min(lower, half)
