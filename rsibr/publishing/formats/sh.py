"""`sh`: the light in nine spherical-harmonic coefficients, as JSON and as text."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from rsibr.light.harmonic_irradiance import COSINE_LOBE, light_coefficients
from rsibr.publishing.published_view import MAKER
from rsibr.publishing.registry import Encoded, register

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedLight

_FUNCTIONS = (
    "0.282095",
    "0.488603 y",
    "0.488603 z",
    "0.488603 x",
    "1.092548 x y",
    "1.092548 y z",
    "0.315392 (3 z^2 - 1)",
    "1.092548 x z",
    "0.546274 (x^2 - y^2)",
)
_ORDER = ("Y00", "Y1-1", "Y10", "Y11", "Y2-2", "Y2-1", "Y20", "Y21", "Y22")
_BASIS = (
    "Real spherical harmonics of bands 0 to 2 of the unit direction (x, y, z) in world coordinates, orthonormal over "
    "the sphere, without the Condon-Shortley sign."
)
_RADIANCE = "coefficients of the radiance, L(d) = sum L_i Y_i(d) [W sr^-1 m^-2]"
_IRRADIANCE = (
    "the same times pi, 2 pi/3, pi/4 by band: E(n) = sum E_i Y_i(n) [W m^-2] is the irradiance of the normal n; a "
    "matte surface of albedo rho has the radiance rho E / pi"
)


@register(
    "sh",
    summary="light in nine spherical-harmonic coefficients, JSON and text",
    files=("sh.json", "sh.txt"),
    of="light",
)
def sh(light: PublishedLight) -> Encoded:
    """Encode the light of a bake, lights without extent included.

    Parameters
    ----------
    light : PublishedLight
        The light.
    """
    radiance = light_coefficients(light.light, delta=True)
    irradiance = radiance * np.array(COSINE_LOBE)[:, None]
    document = {
        "schema": 1,
        "about": light.about,
        "writer": MAKER,
        "basis": _BASIS,
        "order": _ORDER,
        "functions": _FUNCTIONS,
        "radiance_is": _RADIANCE,
        "radiance": radiance.tolist(),
        "irradiance_is": _IRRADIANCE,
        "irradiance": irradiance.tolist(),
    }
    lines = [f"# {light.about}", f"# {_BASIS}", f"# R G B: {_RADIANCE}"]
    for values, name, function in zip(radiance, _ORDER, _FUNCTIONS, strict=True):
        lines.append(f"{' '.join(f'{value:.9g}' for value in values)}  # {name} = {function}")
    text = "\n".join(lines) + "\n"
    return Encoded({"sh.json": (json.dumps(document, indent=1) + "\n").encode(), "sh.txt": text.encode()})
