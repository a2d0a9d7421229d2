"""Environment from photographs of mirror balls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.capture.balls.ball_photograph import BallPhotograph
from rsibr.capture.balls.combined import Shown, combined, disagreements
from rsibr.capture.balls.filled import filled
from rsibr.capture.balls.reflectance import Reflectance
from rsibr.capture.balls.reflection import Seen, seen
from rsibr.capture.exr_parts import write_parts
from rsibr.errors import InputError
from rsibr.geometry.projections.latlong import MITSUBA

RIM_PIXELS = 2.0
"""Pixels along the rim that are left out: they mix the ball with what lies behind it."""

_PER_PIXEL = 4
"""Samples along a side of a pixel in the middle of a ball: with 2 a small lamp's energy depends on where it falls."""

_MOST_SIDE = 32  # samples of a texel
_LANES = 2**23
_OPPOSITE = math.cos(math.radians(170))
_ENOUGH = 4.0
"""Pixels across a ball for each column of the map, below which detail is lost (see `capture_ball`)."""


@dataclass(frozen=True, eq=False)
class BallEnvironment:
    """Result of `capture_ball`.

    Attributes
    ----------
    radiance : ndarray, shape (H, W, 3), float32
        Latitude–longitude map in Mitsuba's orientation, complete.
    seen : ndarray, shape (H, W), bool
        Texels that a photograph shows; the others are filled from around them.
    saturated : ndarray, shape (H, W), bool
        Texels whose radiance is a lower bound.
    notes : tuple of str
        What the user should know.
    """

    radiance: NDArray[np.float32]
    seen: NDArray[np.bool_]
    saturated: NDArray[np.bool_]
    notes: tuple[str, ...]

    def write(self, path: Path | str) -> None:
        """Write the parts `radiance`, `seen` and `saturated` into one OpenEXR file, atomically.

        Its picture is the radiance: it can be given as `environment.file`.
        """
        parts = {"radiance": self.radiance, "seen": self.seen, "saturated": self.saturated}
        write_parts(path, parts)


@backend.in_session
def environment_of(
    balls: Sequence[BallPhotograph],
    reflectance: Reflectance,
    height: int,
    *,
    photographer_deg: float = 5.0,
    rim_pixels: float = RIM_PIXELS,
) -> BallEnvironment:
    """Environment that mirror balls show.

    Parameters
    ----------
    balls : sequence of BallPhotograph
        At least one.
    reflectance : Reflectance
        Of the balls, by which their radiance is divided.
    height : int
        Rows of the map, which has twice as many columns.
    photographer_deg : float
        Half angle about the camera's own reflection that is left out [degrees].
    rim_pixels : float
        Pixels along the rim that are left out.

    Returns
    -------
    BallEnvironment
        Means over each texel, of all balls weighted by cos²(θ/2), where θ is the angle between the light and the
        camera: the middle of a ball shows a direction best. What saturates one ball is taken from the others.

    Raises
    ------
    InputError
        If the photographs show nothing of a ball.
    """
    side = _samples_a_side(balls, 2 * height)
    shown = [_shown(ball, reflectance, height, side, photographer_deg, rim_pixels) for ball in balls]
    mean, weight, saturated = combined(shown)
    covered = weight > 0
    if not covered.any():
        what = f"{', '.join(ball.name for ball in balls)}: shows nothing of a ball where its outline is said to be"
        raise InputError(what, where="shots", fix="give its --circle or --mask in pixels of the photograph")
    complete = filled(mean, weight).astype(np.float32)
    notes = (*disagreements([ball.name for ball in balls], shown), *_notes(balls, height, covered, saturated))
    return BallEnvironment(complete, covered, saturated, notes)


def _shown(
    ball: BallPhotograph,
    reflectance: Reflectance,
    height: int,
    side: int,
    photographer_deg: float,
    rim_pixels: float,
) -> Shown:
    """What one ball shows, in steps of texels that fit one launch."""
    width, picture, sums = 2 * height, _texture(ball), np.zeros((2 * height * height, 7))
    step = max(_LANES // side**2, 1)
    for start in range(0, height * width, step):
        count = min(step, height * width - start)
        sums[start : start + count] = _sums(
            ball, picture, reflectance, (height, width), start, count, side, photographer_deg, rim_pixels
        )
    weight = sums[:, 6].reshape(height, width)
    mean = sums[:, :6].reshape(height, width, 6) / np.where(weight > 0, weight, 1.0)[..., None]
    return Shown(mean[..., :3], weight, (weight > 0) & (mean[..., 3:].max(axis=2) > 0))


def _texture(ball: BallPhotograph) -> mi.Texture2f:
    values = np.concatenate([ball.image.radiance, ball.image.saturated], axis=2, dtype=np.float32)
    return mi.Texture2f(mi.TensorXf(values), wrap_mode=dr.WrapMode.Clamp, filter_mode=dr.FilterMode.Nearest)


def _sums(
    ball: BallPhotograph,
    picture: mi.Texture2f,
    reflectance: Reflectance,
    size: tuple[int, int],
    start: int,
    count: int,
    side: int,
    photographer_deg: float,
    rim_pixels: float,
) -> NDArray[np.float64]:
    """Weighted sums of radiance and saturation, and the weight, of some texels; shape (count, 7)."""
    height, width = size
    block = side * side
    lane = dr.arange(mi.UInt32, count * block)
    texel, sample = lane // block + dr.opaque(mi.UInt32, start), lane % block
    column = mi.Float(texel % width) + (mi.Float(sample % side) + 0.5) / side
    # The first and the last row of Mitsuba's map lie on the poles, and are half as high
    row = dr.clip(mi.Float(texel // width) + (mi.Float(sample // side) + 0.5) / side - 0.5, 0, height - 1)
    p = mi.Point2f(column / width, row / (height - 1))
    found = seen(ball, MITSUBA.direction(mi.UInt32(0), p))
    weight = MITSUBA.density(mi.UInt32(0), p) * _weight(ball, found, photographer_deg, rim_pixels)
    channels = picture.eval(mi.Point2f(found.place.x / ball.camera.width, found.place.y / ball.camera.height))
    mirror = reflectance.at(found.cos_incidence)
    values = [channels[k] / dr.maximum(mirror[k], 1e-6) for k in range(3)] + list(channels[3:6])
    parts = [dr.block_sum(value * weight, block) for value in values] + [dr.block_sum(weight, block)]
    return np.stack([np.array(part, dtype=np.float64) for part in parts], axis=1)


def _weight(ball: BallPhotograph, found: Seen, photographer_deg: float, rim_pixels: float) -> mi.Float:
    """cos²(θ/2) where the ball shows a direction; 0 near the rim, about the camera, and outside the photograph."""
    camera = ball.camera
    rim = rim_pixels * float(np.arcsin(1 / ball.distance)) / ball.radius_pixels
    x, y = found.place.x, found.place.y
    inside = (x > 0) & (y > 0) & (x < camera.width) & (y < camera.height)
    shown = inside & (found.margin > rim) & (found.cos_angle < math.cos(math.radians(photographer_deg)))
    return dr.select(shown, (1 + found.cos_angle) / 2, 0)


def _samples_a_side(balls: Sequence[BallPhotograph], width: int) -> int:
    """Samples along a side of a texel, by the pixels that it covers in the middle of a ball."""
    pixels = max(math.pi * ball.radius_pixels / width for ball in balls)
    return int(np.clip(math.ceil(_PER_PIXEL * pixels), 2, _MOST_SIDE))


def _notes(
    balls: Sequence[BallPhotograph], height: int, covered: NDArray[np.bool_], saturated: NDArray[np.bool_]
) -> tuple[str, ...]:
    notes = []
    for ball in balls:
        across = 2 * ball.radius_pixels
        if across < _ENOUGH * 2 * height:
            most = int(across / _ENOUGH / 2)
            notes.append(
                f"{ball.name}: the ball is {across:.0f} pixels wide, {across / (2 * height):.1f} for each of "
                f"{2 * height} columns: detail is lost above {max(most, 1)} rows"
            )
    for first in range(len(balls)):
        for second in range(first):
            if float(balls[first].view @ balls[second].view) < _OPPOSITE:
                notes.append(
                    f"{balls[second].name} and {balls[first].name} were taken from opposite sides: each one's blind "
                    "spot is the other's camera; take them at 90°"
                )
    if not covered.all():
        notes.append(f"{_share(~covered):.1%} of the directions were seen by no ball, and are filled from around them")
    if saturated.any():
        notes.append(f"{int(saturated.sum())} texels are saturated: their radiance is a lower bound")
    return tuple(notes)


def _share(mask: NDArray[np.bool_]) -> float:
    """Share of the sphere that texels cover."""
    heights = MITSUBA.solid_angles(*MITSUBA.axes(mask.shape))[0]
    return float(heights[mask].sum() / heights.sum())
