"""Scenes that a capture photographs: a mirror ball, a matte ball, and a painted sphere, under a distant environment."""

from __future__ import annotations

from typing import Any

import mitsuba as mi

from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene.config import MaterialConfig
from rsibr.scene.environment import Environment
from rsibr.scene.material import load_material

BALL = "ball"
"""Name of the ball, of radius 1 about the origin."""


def ball_under(environment: Environment, bsdf: mi.BSDF | dict[str, Any]) -> dict[str, Any]:
    """A ball of radius 1 about the origin, under an environment.

    Parameters
    ----------
    environment : Environment
        Light from infinity.
    bsdf : mi.BSDF or dict
        Of the ball.
    """
    material = backend.load(bsdf) if isinstance(bsdf, dict) else bsdf
    return {"environment": environment.emitter(), BALL: {"type": "sphere", "bsdf": material}}


def mirror(metal: str = "Ag") -> dict[str, Any]:
    """Mirror of a metal that Mitsuba knows; `none` reflects everything."""
    return {"type": "conductor", "material": metal}


def matte(reflectance: float = 0.5) -> dict[str, Any]:
    """Lambert's reflector."""
    return {"type": "diffuse", "reflectance": reflectance}


@backend.in_session
def named_ball(kind: str) -> mi.BSDF:
    """BSDF of a ball that a user names.

    Parameters
    ----------
    kind : str
        `mirror:METAL`, `matte:REFLECTANCE`, or the name of a preset material: a painted ball.

    Raises
    ------
    InputError
        If there is no such metal or preset, or the reflectance is out of range.
    """
    name, _, value = kind.partition(":")
    if name == "mirror":
        try:
            return backend.load(mirror(value or "Ag"))
        except RuntimeError as error:
            raise InputError(f"unknown metal '{value}'", where="ball", fix="name Ag, Al, Cr, …") from error
    if name == "matte":
        try:
            reflectance = float(value or 0.5)
        except ValueError:
            reflectance = -1.0
        if not 0 < reflectance <= 1:
            raise InputError(f"a reflectance of {value}", where="ball", fix="give matte:0.5, or another number up to 1")
        return backend.load(matte(reflectance))
    return load_material(MaterialConfig(preset=kind)).bsdf()
