"""Decisions on the light: whether it must be sampled by itself, and whether maps of fewer texels hold what it casts."""

from __future__ import annotations

from dataclasses import dataclass

from rsibr.effects.light_probe import SMALL, LightProbe
from rsibr.effects.lobes import Lobe
from rsibr.effects.material_probe import LobeProbe
from rsibr.effects.plan import NEGLIGIBLE, Effect, decided, number
from rsibr.effects.plan_resolution import LEAST_RESOLUTION, sufficient_resolution
from rsibr.scene.config import EffectsConfig

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
        Whether the config itself says so: then nothing but `effects.resolution = "off"` lowers it.
    """

    asked: int
    explicit: bool


def is_even(light: LightProbe) -> bool:
    """Whether the sky is even enough for its sampling to be a question at all."""
    return light.variance <= EVEN


def sun_effect(light: LightProbe, sampling_ratio: float | None, settings: EffectsConfig, clamp: float | None) -> Effect:
    """Whether directions are drawn from the light beside those from the BSDF, as a sun or a lamp needs it.

    Parameters
    ----------
    light : LightProbe
        The environment.
    sampling_ratio : float or None
        Variance by the BSDF's samples alone over that by both, measured; None where the sky is uneven: a sun that no
        sample of the pilot hit would make it a lie.
    settings : EffectsConfig
        May force it.
    clamp : float or None
        `sampling.clamp`: with small sources it takes their light away.
    """
    policy = "light and BSDF are both sampled, weighted by the balance heuristic; nothing is clamped"
    if clamp is not None:
        policy = f"light and BSDF are both sampled; samples above {clamp:g} are clamped as asked, and darken the maps"
    share = f"{number(100 * light.peak_share)} % of the light from the brightest {100 * SMALL:g} % of the sphere"
    if sampling_ratio is None:
        return decided(
            "sun", settings.sun, light.variance, EVEN, "relative variance of the radiance",
            f"{share}: {policy}", "there is no light",
        )  # fmt: skip
    return decided(
        "sun", settings.sun, sampling_ratio, NO_NOISIER, "times the variance with the BSDF's samples alone",
        f"the sky is even, but the light's samples lower the noise: {policy}",
        f"the sky is even (relative variance {number(light.variance)}): the BSDF's samples alone are no noisier",
    )  # fmt: skip


def resolution_effect(
    lobes: list[Lobe], probes: tuple[LobeProbe, ...], light: LightProbe, resolution: Resolution, settings: EffectsConfig
) -> tuple[Effect, int]:
    """Whether the maps' full resolution is called for.

    Returns
    -------
    effect : Effect
        "resolution", on where the maps keep all their texels.
    resolution : int
        Texels a side that the bake takes.
    """
    lower, error = sufficient_resolution(lobes, probes, light, resolution.asked, NEGLIGIBLE)
    half = max(LEAST_RESOLUTION, resolution.asked // 2)
    forced = settings.resolution
    if forced == "auto" and resolution.explicit and lower < resolution.asked:
        why = f"{lower}² texels would do (relMSE {number(error)}), but the config asks for {resolution.asked}²"
        kept = Effect("resolution", True, None, error, NEGLIGIBLE, f"relMSE of a map of {lower}²", why)
        return kept, resolution.asked
    effect = decided(
        "resolution", forced, min(error, 1.0), NEGLIGIBLE, f"relMSE of a map of {min(lower, half)}²",
        f"a map of {half}² would be too coarse", f"maps of {lower}² hold all that this light casts",
        error_if_left_out=min(error, 1.0),
    )  # fmt: skip
    return effect, resolution.asked if effect.on else min(lower, half)
