"""Which place of a photograph shows the light from a direction, mirrored by a ball at a finite distance.

With the distance D from the camera to the centre in radii, the angle β between a ray and the axis, and the incidence i
at the point that it meets: sin i = D sin β, and the light comes from the angle θ = 2i − β to the direction of the
camera. θ grows from 0 in the middle to π − asin(1/D) at the rim; what lies beyond is the blind cone behind the ball. A
camera at infinity has β = 0 and θ = 2i, the orthographic mirror ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.capture.balls.ball_photograph import BallPhotograph

_NEWTON = 6
"""Steps that solve for the incidence; the error is then below the rounding of float32."""


@dataclass
class Seen:
    """Where a ball shows some directions, one a lane.

    Attributes
    ----------
    place : mi.Point2f
        In the photograph [pixels].
    cos_incidence : mi.Float
        At the point of the ball.
    cos_angle : mi.Float
        Between the direction of the light and that of the camera.
    margin : mi.Float
        Angle between the ray and the rim [rad]; negative in the blind cone.
    """

    place: mi.Point2f
    cos_incidence: mi.Float
    cos_angle: mi.Float
    margin: mi.Float


def seen(ball: BallPhotograph, d: mi.Vector3f) -> Seen:
    """Where a photograph shows the light from unit world directions."""
    distance, view = ball.distance, ball.view
    v = mi.Vector3f(*view.tolist())
    cos_angle = dr.clip(dr.dot(d, v), -1, 1)
    angle = dr.safe_acos(cos_angle)
    incidence = _incidence(angle, distance)
    beta = dr.safe_asin(dr.sin(incidence) / distance)
    away = d - cos_angle * v
    size = dr.norm(away)
    across = dr.select(size > 1e-6, away / dr.maximum(size, 1e-6), mi.Vector3f(*ball.camera.axes[:, 0].tolist()))
    ray = dr.sin(beta) * across - dr.cos(beta) * v
    most = mi.Float(np.pi - np.arcsin(1 / distance))
    rim = mi.Float(np.arcsin(1 / distance))
    beyond = dr.select(angle > most, most - angle, rim - beta)
    return Seen(_project(ball, ray), dr.cos(incidence), cos_angle, beyond)


def _incidence(angle: mi.Float, distance: float) -> mi.Float:
    """Solve 2i − asin(sin i / D) = θ for i in [0, π/2] by Newton's method; the left side grows and is nearly linear."""
    incidence = dr.minimum(angle / (2 - 1 / distance), np.pi / 2)
    for _ in range(_NEWTON):
        sine, cosine = dr.sincos(incidence)
        beta = dr.safe_asin(sine / distance)
        slope = 2 - cosine / (distance * dr.maximum(dr.cos(beta), 1e-6))
        incidence = dr.clip(incidence - (2 * incidence - beta - angle) / dr.maximum(slope, 1e-3), 0, np.pi / 2)
    return incidence


def _project(ball: BallPhotograph, ray: mi.Vector3f) -> mi.Point2f:
    camera = ball.camera
    right, down, forward = (mi.Vector3f(*column.tolist()) for column in camera.axes.T)
    depth = dr.dot(ray, forward)
    x, y = (
        dr.dot(ray, axis) / depth * float(focal) + float(middle)
        for axis, focal, middle in zip((right, down), camera.focal, camera.principal, strict=True)
    )
    return mi.Point2f(x, y)


def light_direction(distance: float, beta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle θ of the light from the direction of the camera for rays at the angle β from the axis [rad].

    Examples
    --------
    >>> light_direction(1e9, np.array([0.5e-9])).round(4).tolist()     # sin i = ½: θ = 60° from a camera at infinity
    [1.0472]
    """
    incidence = np.arcsin(np.clip(distance * np.sin(beta), -1, 1))
    return np.asarray(2 * incidence - beta)
