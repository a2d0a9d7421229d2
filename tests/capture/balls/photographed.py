"""Balls that Mitsuba photographs."""

from __future__ import annotations

import numpy as np

from rsibr.capture.balls.ball_photograph import BallPhotograph
from rsibr.capture.brackets.hdr_image import HdrImage
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.synthetic.rendering import rendered
from rsibr.capture.synthetic.scenes import ball_under


def framed(view, distance, pixels, shift=(0.0, 0.0)):
    """Camera that looks at the ball, a little past it by `shift` in radii."""
    toward = np.array(view, dtype=np.float64)
    position = toward / np.linalg.norm(toward) * distance
    up = (0, 1, 0) if abs(toward[1]) < 0.9 * np.linalg.norm(toward) else (0, 0, -1)
    field = 2.3 * np.degrees(np.arcsin(1 / distance)) * (1 + np.hypot(*shift))
    return Pinhole.looking(position, (shift[0], shift[1], 0), up, fov_deg=field, width=pixels, height=pixels)


def photographed(environment, bsdf, camera, name="ball", samples=16):
    """Photograph without noise, and the share of each pixel that the ball covers."""
    radiance, alpha = rendered(ball_under(environment, bsdf), camera, samples=samples)
    nothing = np.zeros_like(radiance)
    return BallPhotograph(HdrImage(radiance, nothing, nothing > 0), camera, name), alpha
