"""Scenes that a capture photographs: a mirror ball, a matte ball, and a painted sphere, under a distant environment."""

from __future__ import annotations

from typing import Any

import mitsuba as mi

from rsibr import backend
from rsibr.scene.environment import Environment

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
