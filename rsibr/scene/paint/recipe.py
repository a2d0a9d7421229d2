"""Parameters of a car paint, validated, and the layers that follow from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.geometry.sphere_interaction import interaction
from rsibr.scene.paint.layers import CoatTables, Gloss, solve_layers
from rsibr.scene.paint.pigments import pigment_reflectance, pigment_spectrum
from rsibr.scene.paint.spectra import NODES

Colour = NDArray[np.float64]

FLAKE_FILM = 4.0
"""Thickness of the layer that holds the flakes [µm]: a flake of diameter D tilts by about `FLAKE_FILM` / D.

A heuristic, after the observation that coarse flakes lie flatter than fine ones; not measured.
"""

_RANGES: dict[str, tuple[float, float]] = {
    "int_ior": (1.01, 3.0),
    "coat_alpha": (0.0, 0.3),
    "coat_thickness": (0.0, 1e4),
    "coat_absorption": (0.0, 1e4),
    "pigment": (0.0, 1.0),
    "flake_tint": (0.0, 1.0),
    "flake_size": (FLAKE_FILM, 20 * FLAKE_FILM),
    "flake_density": (0.0, 1e6),
    "retro_share": (0.0, 1.0),
    "retro_alpha": (0.05, 1.0),
}
_UNBOUNDED = ("coat_absorption",)


@dataclass(frozen=True, eq=False)
class PaintRecipe:
    """Parameters of a car paint, all with defaults. Colours are arrays of shape (C,).

    Attributes
    ----------
    pigment : Colour
        Reflectance of the pigment, in [0, 1]. A file may name a measured patch instead; see `pigments.py`.
    flake_tint : Colour
        Reflectance of a metal flake inside the coat, in [0, 1].
    flake_size : float
        Diameter of a flake [µm], 4 to 80; determines the tilt of the flakes, see `FLAKE_FILM`.
    flake_density : float
        Flakes per area [mm⁻²]; with the size it determines the covered share of the pigment.
    int_ior : float
        Index of refraction of the clear coat; polyurethane has 1.5.
    coat_alpha : float
        GGX roughness α of the coat's surface, 0 to 0.3; 0 is smooth.
    coat_thickness : float
        Thickness of the clear coat [µm].
    coat_absorption : Colour
        Absorption coefficient of the clear coat [mm⁻¹]; the colour of a candy paint.
    retro_share : float
        Retroreflective share of the area between the flakes, in [0, 1].
    retro_alpha : float
        GGX roughness α of the retroreflective lobe.
    """

    pigment: Colour = field(default_factory=lambda: np.full(3, 0.5))
    flake_tint: Colour = field(default_factory=lambda: np.full(3, 0.9))
    flake_size: float = 16.0
    flake_density: float = 0.0
    int_ior: float = 1.5
    coat_alpha: float = 0.015
    coat_thickness: float = 40.0
    coat_absorption: Colour = field(default_factory=lambda: np.zeros(3))
    retro_share: float = 0.0
    retro_alpha: float = 0.2

    def __post_init__(self) -> None:
        for name, (lowest, highest) in _RANGES.items():
            value = np.asarray(getattr(self, name))
            if not ((value >= lowest) & (value <= highest)).all():
                shown = ", ".join(f"{x:g}" for x in np.atleast_1d(value))
                raise InputError(f"{name} is {shown}, and may be {lowest:g} to {highest:g}")

    @classmethod
    def from_properties(cls, properties: mi.Properties) -> PaintRecipe:
        """Read the parameters of a plugin in the channels of the current variant.

        In spectral variants there is a channel for each of `rsibr.scene.paint.spectra.NODES`.

        Raises
        ------
        InputError
            If a parameter is unknown or out of range.
        """
        given: dict[str, Any] = {}
        for parameter in fields(cls):
            name = parameter.name
            if name in properties:
                is_colour = parameter.type == "Colour"
                given[name] = _colour(properties, name) if is_colour else _number(properties, name)
            elif parameter.type == "Colour":
                given[name] = np.full(_channels(), cls().__dict__[name][0])
        if unknown := properties.unqueried():
            names = ", ".join(f"'{name}'" for name in unknown)
            known = ", ".join(parameter.name for parameter in fields(cls))
            raise InputError(f"car paint has no {names}, only: {known}")
        return cls(**given)

    @property
    def coverage(self) -> float:
        """Area share covered by randomly placed, overlapping flakes (Boolean model): 1 − exp(−density · area)."""
        area = math.pi / 4 * (self.flake_size * 1e-3) ** 2
        return -math.expm1(-self.flake_density * area)

    @property
    def depth(self) -> tuple[float, ...]:
        """Optical depth of the coat along the normal."""
        return _tuple(self.coat_absorption * self.coat_thickness * 1e-3)  # 1/mm times µm

    @property
    def flakes(self) -> Gloss:
        """Glossy lobe of the flakes."""
        return Gloss(_tuple(self.flake_tint * self.coverage), FLAKE_FILM / self.flake_size)

    @property
    def retro(self) -> Gloss:
        """Retroreflective lobe; its microfacets are perfect reflectors."""
        share = (1 - self.coverage) * self.retro_share
        return Gloss((share,) * len(self.pigment), self.retro_alpha, backward=True)

    def solve(self) -> CoatTables:
        """Tabulate the interreflection of the layers."""
        return solve_layers(
            self.int_ior,
            self.coat_alpha,
            self.depth,
            _tuple(self.pigment * (1 - self.coverage) * (1 - self.retro_share)),
            (self.flakes, self.retro) if self.retro_share > 0 else (self.flakes,),
        )


def _tuple(values: Colour) -> tuple[float, ...]:
    return tuple(values.tolist())


def _number(properties: mi.Properties, name: str) -> float:
    value = properties[name]
    if not isinstance(value, int | float):
        raise InputError(f"{name} is {value!r}, and may only be a number")
    return float(value)


def _channels() -> int:
    return len(NODES) if mi.is_spectral else dr.size_v(mi.UnpolarizedSpectrum)


def _colour(properties: mi.Properties, name: str) -> Colour:
    if properties.type(name) == mi.Properties.Type.String:
        return _pigment(properties[name])
    read = properties.get_unbounded_texture if name in _UNBOUNDED else properties.get_texture
    texture, si = read(name), interaction(mi.Vector3f(0, 0, 1))
    if not mi.is_spectral:
        return np.array(texture.eval(si), dtype=np.float64).ravel()
    values = []
    for four in NODES.reshape(-1, 4):
        si.wavelengths = mi.UnpolarizedSpectrum([dr.opaque(mi.Float, nm) for nm in four.tolist()])
        values.append(np.array(texture.eval(si), dtype=np.float64).ravel())
    return np.concatenate(values)


def _pigment(name: str) -> Colour:
    if mi.is_spectral:
        return pigment_spectrum(name, NODES)
    colour = pigment_reflectance(name)
    return colour if _channels() == 3 else colour @ [[0.2126], [0.7152], [0.0722]]
