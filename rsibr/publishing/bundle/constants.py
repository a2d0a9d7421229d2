"""Constants of the methods that the page's engine takes from Python."""

from __future__ import annotations

from rsibr.lobes import albedo, basis, facet_moments, proxy_ratio
from rsibr.methods.rsibr import (
    anisotropic_footprint,
    belief,
    delta_light_lobes,
    delta_lobe,
    half_vector_lobes,
    half_vector_pyramid,
    polar_grid,
    residual_transport,
)
from rsibr.methods.warp_blend import warp

assert facet_moments.NODES == proxy_ratio.NODES  # one name in the shaders


def constants() -> dict[str, float]:
    """Constants by the name that they have in GLSL and JavaScript; whole numbers are integers there."""
    (_, _), (_, middle), (place, side) = anisotropic_footprint._HERMITE
    return {
        "FADE_RADIUS": warp.FADE_RADIUS,
        "LEAST_CONFIDENCE": warp.LEAST_CONFIDENCE,
        "NODES": facet_moments.NODES,
        "ALBEDO_NODES": albedo.NODES,
        "BELIEF_NODES": belief.NODES,
        "RINGS": float(polar_grid.RINGS),
        "SECTORS": float(polar_grid.SECTORS),
        "FIRST_VARIANCE": half_vector_pyramid._FIRST,
        "LEAST_HEIGHT": half_vector_pyramid._LEAST_HEIGHT,
        "LEAST_VIEW_COSINE": anisotropic_footprint._LEAST_VIEW_COSINE,
        "GRAZING": anisotropic_footprint._GRAZING,
        "LEAST_TAP": anisotropic_footprint._LEAST_TAP,
        "HERMITE_PLACE": place,
        "HERMITE_MIDDLE": middle,
        "HERMITE_SIDE": side,
        "RADIAL_STEP": half_vector_lobes._STEP,
        "RADIAL_MOST": float(half_vector_lobes._MOST),
        "RADIAL_FLATTEST": half_vector_lobes._FLATTEST,
        "FINE_MAP": float(half_vector_lobes._FINE_MAP),
        "MIRROR_FEWEST": float(delta_lobe._FEWEST),
        "MIRROR_MOST": float(delta_lobe._MOST),
        "MIRROR_FLATTEST": delta_lobe._FLATTEST,
        "DELTA_DENSITY": delta_light_lobes._DENSITY,
        "DELTA_FEWEST": float(delta_light_lobes._FEWEST),
        "DELTA_MOST": float(delta_light_lobes._MOST),
        "DELTA_FLATTEST": delta_light_lobes._FLATTEST,
        "COAT_IOR": basis.COAT_IOR,
        "RESIDUAL_LEAST_COSINE": residual_transport._LEAST_COSINE,
        "LEAST_TRUST": residual_transport._LEAST_TRUST,
        "AT_A_STORED_VIEW": residual_transport._AT_A_STORED_VIEW,
        "BRIGHTEST": residual_transport.BRIGHTEST,
        "DARKEST": residual_transport.DARKEST,
    }


def glsl(named: dict[str, float]) -> str:
    """Declarations of constants in GLSL.

    Examples
    --------
    >>> print(glsl({"NODES": 33, "GRAZING": 0.02}), end="")
    const int NODES = 33;
    const float GRAZING = 0.02;
    """
    kinds = {name: "int" if isinstance(value, int) else "float" for name, value in named.items()}
    return "".join(f"const {kinds[name]} {name} = {value!r};\n" for name, value in named.items())
