"""Decisions on the lobes: which are simulated, which need maps, from how many views."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

from rsibr.geometry.viewpoints import VIEW_COUNTS
from rsibr.light.probe import LightProbe
from rsibr.planning.material_probe import LobeProbe, MaterialProbe
from rsibr.planning.model import interpolation_error, relative_power
from rsibr.planning.plan import NEGLIGIBLE, Effect, LobePlan, decided, number
from rsibr.scene.config import EffectsConfig

COAT_ALPHA = 0.1
"""Roughness α up to which the narrowest of several lobes counts as a clear coat."""

PRESENT = 1e-9
"""relMSE above which a lobe counts as present; present lobes are simulated, however faint."""

_ENOUGH = 1e-3
"""relMSE of uncorrected interpolation up to which a number of views suffices for a lobe."""

IN_SPECTRA = "its closed form is in RGB, and maps are rendered in spectra"
"""Reason why a lobe that has a closed form gets maps nevertheless."""

Weights = dict[str, float]
"""relMSE of leaving out each lobe, by name."""

LOBE_EFFECTS = ("diffuse", "glossy", "clear_coat", "mirror")
"""Effects that are lobes of the material."""


class Reflecting(Protocol):
    """A lobe of a material, as fitted or as probed."""

    @property
    def kind(self) -> str:
        """One of "diffuse", "glossy", "mirror"."""

    @property
    def alpha(self) -> float:
        """Roughness α."""


def effect_of(lobe: Reflecting, lobes: Sequence[Reflecting]) -> str:
    """Name of the effect that a lobe belongs to, one of `LOBE_EFFECTS`.

    The clear coat is the narrowest glossy lobe, up to `COAT_ALPHA`, if another lobe lies below it.
    """
    if lobe.kind != "glossy":
        return lobe.kind
    narrowest = min((other.alpha for other in lobes if other.kind == "glossy"), default=0.0)
    covers = any(other.kind != "mirror" and other is not lobe for other in lobes)
    return "clear_coat" if lobe.alpha == narrowest and lobe.alpha <= COAT_ALPHA and covers else "glossy"


def lobe_effects(material: MaterialProbe, left_out: Weights, settings: EffectsConfig) -> Iterator[Effect]:
    """Decide on each kind of lobe: on if the material has it, unless forced off."""
    names = {
        "diffuse": ("a matte lobe: it follows the normal", "the material has no matte lobe"),
        "glossy": (
            "glossy lobes: each follows the mirror direction with a width of its own",
            "the material has no further glossy lobe",
        ),
        "clear_coat": ("a narrow lobe over wider ones", "the material has no narrow lobe over wider ones"),
        "mirror": ("a perfect mirror: environment lookup times Fresnel", "the material has no perfect mirror"),
    }
    for name, (why_on, why_off) in names.items():
        members = [lobe for lobe in material.lobes if effect_of(lobe, material.lobes) == name]
        error = sum(left_out[lobe.name] for lobe in members)
        share = sum(lobe.share for lobe in members)
        roughness = ", ".join(f"α {lobe.alpha:.3g}" for lobe in members if lobe.kind == "glossy")
        more = f" ({roughness})" if roughness else ""
        yield decided(
            name, getattr(settings, name), share, PRESENT, "of the reflected light", why_on + more, why_off,
            error_if_left_out=min(1.0, error),
        )  # fmt: skip


def fresnel_effect(material: MaterialProbe, settings: EffectsConfig) -> Effect:
    """Decide whether the directional albedo varies enough with the view angle to be divided out and put back."""
    return decided(
        "fresnel", settings.fresnel, material.fresnel, NEGLIGIBLE, "relMSE of an albedo that is the same at all angles",
        "the albedo of each lobe follows the surface's view angle", "the albedo is nearly constant over the angle",
        error_if_left_out=material.fresnel,
    )  # fmt: skip


def view_effect(
    material: MaterialProbe, left_out: Weights, light: LightProbe, settings: EffectsConfig, no_closed_form: bool = False
) -> Effect:
    """Decide whether stored views are needed, or every lobe has a closed form."""
    residual = max(closed_form_error(lobe, left_out[lobe.name], light) for lobe in material.lobes)
    effect = decided(
        "view_dependence", settings.view_dependence, residual, NEGLIGIBLE, "relMSE of closed forms, estimated",
        "maps from several views are interpolated", _without_views(material, light),
        error_if_left_out=min(1.0, residual),
    )  # fmt: skip
    if no_closed_form and not effect.on and effect.forced is None:
        return replace(effect, on=True, why=IN_SPECTRA, error_if_left_out=None)
    return effect


def lobe_maps(
    lobe: LobeProbe, left_out: float, light: LightProbe, forced: str = "auto", no_closed_form: bool = False
) -> LobePlan:
    """Decide whether a lobe needs maps, and from how many views.

    Parameters
    ----------
    lobe : LobeProbe
        The lobe.
    left_out : float
        relMSE of leaving it out, see `rsibr.planning.maps.left_out_errors`.
    light : LightProbe
        The environment.
    forced : {"auto", "on", "off"}
        `effects.view_dependence` of the config.
    no_closed_form : bool
        Whether closed forms, which multiply RGB values, are invalid: spectra that vary over the sky.

    Returns
    -------
    LobePlan

    Notes
    -----
    There are three closed forms. Under a constant sky L = E(θ) L₀ for every lobe. A delta lobe is E(θ) times the
    environment in the mirror direction. A matte lobe is E(θ) times the irradiance at its normal over π, as far as it is
    Lambertian. Their error is estimated; maps are needed if it is above `NEGLIGIBLE`.
    """
    error = closed_form_error(lobe, left_out, light)
    needed = error > NEGLIGIBLE or no_closed_form if forced == "auto" else forced == "on"
    if needed and error <= NEGLIGIBLE and no_closed_form:
        return LobePlan(lobe.name, True, VIEW_COUNTS[0], error, NEGLIGIBLE, IN_SPECTRA)
    if not needed:
        why = _closed_form(lobe, light) if error <= NEGLIGIBLE else "forced off: the nearest closed form is used"
        return LobePlan(lobe.name, False, 0, error, NEGLIGIBLE, why)
    if lobe.kind == "diffuse":
        why = f"its shape deviates from Lambert's by {number(lobe.shape_error)}, relative"
        return LobePlan(lobe.name, True, VIEW_COUNTS[0], error, NEGLIGIBLE, why)
    views = next(
        (count for count in VIEW_COUNTS if interpolation_error(lobe, left_out, light, count) <= _ENOUGH),
        VIEW_COUNTS[-1],
    )
    reached = interpolation_error(lobe, left_out, light, views)
    why = f"interpolation between {views} views has an estimated error of {number(reached)} before corrections"
    return LobePlan(lobe.name, True, views, error, NEGLIGIBLE, why)


def closed_form_error(lobe: LobeProbe, left_out: float, light: LightProbe) -> float:
    """Estimated error (relMSE) of the best closed form of a lobe; see `lobe_maps`."""
    if lobe.kind == "mirror" or light.is_black:
        return 0.0
    uneven = max(relative_power(lobe, light) - 1, 0.0)
    if lobe.kind == "diffuse":
        # The deviation from Lambert's shape integrates to 0, so that the sky's mean contributes no error
        uneven = min(uneven, min(1.0, light.variance) * lobe.shape_error**2)
    # An albedo by polar angle represents neither anisotropy nor a texture
    return float(left_out * min(1.0, uneven + lobe.anisotropy**2 + lobe.variation**2))


def _closed_form(lobe: LobeProbe, light: LightProbe) -> str:
    if light.is_black:
        return "there is no light"
    if lobe.kind == "mirror":
        return "closed form: the environment in the mirror direction, times the albedo of the angle"
    if light.variance <= NEGLIGIBLE:
        return "closed form: under a constant sky, its radiance times the albedo of the angle"
    if lobe.kind == "diffuse":
        return "closed form: the irradiance of the normal, times the albedo of the angle over π"
    return "its light is negligible or nearly constant here"


def _without_views(material: MaterialProbe, light: LightProbe) -> str:
    if light.is_black:
        return "there is no light"
    if light.variance <= NEGLIGIBLE:
        return "under a constant sky every map is its radiance times the albedo: none is baked"
    kinds = {lobe.kind for lobe in material.lobes}
    if kinds == {"diffuse"}:
        return "a matte material looks the same from every view: one map indexed by the normal"
    if kinds == {"mirror"}:
        return "a perfect mirror needs no bake: environment lookup times Fresnel"
    return "every lobe has a closed form"
