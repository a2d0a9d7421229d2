"""Decisions on the light: whether it must be sampled by itself, and whether maps of fewer texels hold what it casts."""

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
"""Relative variance of the radiance up to which a sky counts as even: the BSDF's samples miss no source in it."""

NO_NOISIER = 1.0
"""Variance by the BSDF's samples alone, over that with the light's samples, up to which these are work for nothing."""


@dataclass(frozen=True)
class Resolution:
    """Texels a side of the maps.

    Attributes
    ----------
    asked : int
        By the config, or its default.
    explicit : bool
        Whether the config says so, not "auto": then nothing but `effects.resolution = "off"` lowers it.
    """

    asked: int
    explicit: bool


def is_even(light: LightProbe) -> bool:
    """Whether the sky is even enough for its sampling to be a question at all."""
    return light.variance <= EVEN


def sampling_effect(
    light: LightProbe,
    material: MaterialProbe,
    sampling_ratio: float | None,
    settings: EffectsConfig,
    sampling: SamplingConfig,
) -> Effect:
    """Whether directions are drawn from the light beside those from the BSDF, as a sun or a lamp needs it.

    Parameters
    ----------
    light, material
        What was measured.
    sampling_ratio : float or None
        Variance by the BSDF's samples alone over that by both, measured; None where the sky is uneven: a sun that no
        sample of the pilot hit would make it a lie.
    settings : EffectsConfig
        May force it.
    sampling : SamplingConfig
        Its `clamp` takes the light of small sources away; its samples share what noise they would leave alone.

    Raises
    ------
    InputError
        If it is forced off under a source that only the light's own sampling can hit.
    """
    if settings.light_sampling == "off" and light.variance == UNRESOLVED:
        raise InputError(
            "'off' would leave out the whole light: no sample of the BSDF hits a source without extent",
            where="effects.light_sampling",
            fix='leave it at "auto"',
        )
    policy = "light and BSDF are both sampled, weighted by the balance heuristic; nothing is clamped"
    if sampling.clamp is not None:
        policy = (
            f"light and BSDF are both sampled; samples above {sampling.clamp:g} are clamped as asked: too dark maps"
        )
    share = f"{number(100 * light.peak_share)} % of the light from the brightest {100 * SMALL:g} % of the sphere"
    evidence, threshold, unit = light.variance, EVEN, "relative variance of the radiance"
    why_on, why_off = f"a sun or lamps, {share}: {policy}", "there is no light"
    if all(lobe.kind == "mirror" for lobe in material.lobes):
        evidence, why_off = 0.0, "a perfect mirror is met by no sample of the light"
    elif sampling_ratio is not None:
        evidence, threshold, unit = sampling_ratio, NO_NOISIER, "times the variance with the BSDF's samples alone"
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
    """Whether the maps' full resolution is called for.

    Returns
    -------
    effect : Effect
        On where the maps keep all their texels.
    resolution : int
        Texels a side that the bake takes.
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
        f"maps of {half}² would be too coarse", f"maps of {lower}² hold all that this light casts",
        error_if_left_out=min(error, 1.0),
    )  # fmt: skip
    return effect, asked if effect.on else min(lower, half)
