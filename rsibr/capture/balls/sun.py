"""Energy of a source that saturated every photograph, from a photograph of a matte ball that it lights."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from rsibr.capture.balls.ball_photograph import BallPhotograph
from rsibr.capture.lamps.hat import hat_integrals, texel_centres
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame

Array = NDArray[np.float64]

_FARTHEST = math.radians(10)
"""Angle from the centroid of the saturated texels within which the source is sought."""

_AT_LIMIT = 0.98  # share of this angle from which on the search counts as stopped by its limit
_MOST_MATTE = 1.05  # of a ball that reflects everything, and errors
_MOST_RESIDUAL = 0.3
_LEAST_LIT = 20
_PIXELS = 4000  # of the ball, at most
_RIM = 0.95  # sine of the angle between normal and view, beyond which pixels are left out
_LEAST_SHADE = 0.05
_COARSE = 48  # rows of the map from which the ball's irradiance is summed


@dataclass(frozen=True, eq=False)
class Sun:
    """Result of `sun_of`.

    Attributes
    ----------
    direction : ndarray, shape (3,)
        Unit, toward the source, within 10° of the centroid of the saturated texels.
    irradiance : ndarray, shape (3,)
        R, G, B on a surface that faces it [W m⁻²].
    reflectance : ndarray, shape (3,)
        Of the ball, as given or as found.
    residual : float
        Relative root mean square difference between the photograph and its explanation.
    """

    direction: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    reflectance: NDArray[np.float64]
    residual: float


def saturated_source(saturated: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Largest connected set of saturated texels of a latitude–longitude map, and the direction of its centroid.

    Parameters
    ----------
    saturated : ndarray, shape (H, W)

    Raises
    ------
    InputError
        If nothing is saturated.
    """
    if not saturated.any():
        raise InputError("nothing in it is saturated: its energy is known", where="environment", fix="use it as it is")
    height, width = saturated.shape
    labels, _ = ndimage.label(np.concatenate([saturated, saturated], axis=1), structure=np.ones((3, 3)))
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    twice = labels == np.argmax(sizes)  # one across the seam is whole in the doubled map
    region = twice[:, :width] | twice[:, width:]
    weights = region * hat_integrals(height, width)[:, None]
    direction = (texel_centres(height, width) * weights[..., None]).sum(axis=(0, 1))
    return region, np.asarray(direction / np.linalg.norm(direction))


def sun_of(
    radiance: NDArray[np.floating],
    saturated: NDArray[np.bool_],
    ball: BallPhotograph,
    reflectance: float | None = None,
) -> Sun:
    """Find the energy of the saturated source.

    Parameters
    ----------
    radiance : ndarray, shape (H, W, 3)
        Latitude–longitude map in Mitsuba's orientation, in the same units as the photograph.
    saturated : ndarray, shape (H, W)
        Texels whose radiance is a lower bound.
    ball : BallPhotograph
        Matte ball, not saturated.
    reflectance : float, optional
        Of the ball; by default found from the side that the source does not light.

    Returns
    -------
    Sun

    Raises
    ------
    InputError
        If nothing is saturated, too little of the ball is seen, the source does not light the side that is seen, or the
        photograph is not that of a matte ball in this light.

    Notes
    -----
    A matte ball shows L(n) = ρ/π (E(n) + E_s max(0, n·s)), with the irradiance E(n) of the map without the source. Both
    ρ and ρ E_s are linear in the photograph: least squares.
    """
    region, centroid = saturated_source(saturated)
    normals, seen = _ball_pixels(ball)
    around = _irradiance(np.where(region[..., None], 0.0, radiance), normals)
    if (normals @ centroid > _LEAST_SHADE).sum() < _LEAST_LIT:
        what = "the side of the ball that is seen is not lit by the source"
        raise InputError(what, where=ball.name, fix="photograph it from the side of the sun")
    shown = np.pi * seen
    direction = _refined(centroid, lambda toward: _explained(around, normals @ toward, shown, reflectance)[2].ravel())
    matte, energy, rest = _explained(around, normals @ direction, shown, reflectance)
    if not (matte > 0).all():
        what = "the ball's reflectance cannot be found in it"
        raise InputError(what, where=ball.name, fix="give its --reflectance")
    residual = float(np.sqrt(np.mean(rest**2) / max(float(np.mean(shown**2)), 1e-300)))
    _check(float(direction @ centroid), matte, energy, residual, ball.name)
    return Sun(direction, np.maximum(energy / matte, 0.0), matte, residual)


def _check(cosine: float, matte: Array, energy: Array, residual: float, name: str) -> None:
    """Raise an InputError where the photograph is not that of a matte ball in the light of the map."""
    wrong = ""
    if not energy.max() > 0:
        wrong = "the ball is darker than the map without its source would light it"
    elif matte.max() > _MOST_MATTE:
        wrong = f"the ball would have to reflect {matte.max():.3g} times the light that falls on it"
    elif cosine < math.cos(_FARTHEST * _AT_LIMIT):
        wrong = (
            f"the light on the ball ends more than {math.degrees(_FARTHEST):.0f}° from where the map's source ends it"
        )
    elif residual > _MOST_RESIDUAL:
        wrong = f"the light of the map and its source leave {residual:.0%} of it unexplained"
    if wrong:
        fix = "check its --view, --up and outline, and that it has the exposure units of the map"
        raise InputError(wrong, where=name, fix=fix)


def _explained(around: Array, facing: Array, shown: Array, reflectance: float | None) -> tuple[Array, Array, Array]:
    """Reflectance, reflectance times the source's irradiance, and what they leave unexplained, by channel."""
    lit = np.maximum(facing, 0.0)
    matte = np.full(3, np.nan if reflectance is None else reflectance)
    energy = np.empty(3)
    for k in range(3):
        if reflectance is None:
            (matte[k], energy[k]), *_ = np.linalg.lstsq(np.stack([around[:, k], lit], axis=1), shown[:, k], rcond=None)
        else:
            energy[k] = lit @ (shown[:, k] - reflectance * around[:, k]) / (lit @ lit)
    return matte, energy, matte * around + lit[:, None] * energy - shown


def _refined(toward: Array, left_over: Callable[[Array], Array]) -> Array:
    """Direction near another for which least is left unexplained: where the light on the ball ends tells it best."""
    side, other, _ = view_frame(toward).T

    def direction(slopes: Array) -> Array:
        moved = toward + slopes[0] * side + slopes[1] * other
        return np.asarray(moved / np.linalg.norm(moved))

    bound = math.tan(_FARTHEST)
    found = optimize.least_squares(lambda slopes: left_over(direction(slopes)), np.zeros(2), bounds=(-bound, bound))
    return direction(found.x)


def with_sun(radiance: NDArray[np.floating], saturated: NDArray[np.bool_], sun: Sun) -> NDArray[np.float32]:
    """Map whose saturated source holds its energy: even radiance over its texels, as wide as it is in the map."""
    region, _ = saturated_source(saturated)
    facing = np.maximum(texel_centres(*region.shape) @ sun.direction, 0.0)
    size = float((region * facing * hat_integrals(*region.shape)[:, None]).sum())
    lit = np.array(radiance, dtype=np.float64)
    lit[region] = sun.irradiance / size
    return lit.astype(np.float32)


def _ball_pixels(ball: BallPhotograph) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normals and radiances of pixels on the ball, away from its rim; none that is saturated."""
    camera, distance = ball.camera, ball.distance
    row, column = np.mgrid[: camera.height, : camera.width]
    rays = camera.directions(np.stack([column.ravel() + 0.5, row.ravel() + 0.5], axis=1))
    along = -(rays @ camera.position)
    under = along**2 - distance**2 + 1
    near = along - np.sqrt(np.maximum(under, 0.0))
    normals = camera.position + near[:, None] * rays
    facing = -(normals * rays).sum(axis=1)
    usable = (under > 0) & (facing > np.sqrt(1 - _RIM**2)) & ~ball.image.saturated.any(axis=2).ravel()
    chosen = np.flatnonzero(usable)
    if len(chosen) < 100:
        raise InputError(f"shows {len(chosen)} usable pixels of the ball", where=ball.name, fix="expose it less")
    chosen = chosen[:: max(len(chosen) // _PIXELS, 1)]
    return normals[chosen], ball.image.radiance.reshape(-1, 3)[chosen].astype(np.float64)


def _irradiance(radiance: NDArray[np.floating], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Irradiance of a map at normals, shape (n, 3), summed over blocks of its texels."""
    height, width = radiance.shape[:2]
    weights = hat_integrals(height, width)[:, None]
    directions = texel_centres(height, width)
    step = max(height // _COARSE, 1)
    energy = _block_sums(radiance * weights[..., None], step)
    middle = _block_sums(directions * (weights * radiance.mean(axis=2) + 1e-12 * weights)[..., None], step)
    toward = middle / np.maximum(np.linalg.norm(middle, axis=-1, keepdims=True), 1e-300)
    return np.asarray(np.maximum(normals @ toward.T, 0.0) @ energy)


def _block_sums(image: NDArray[np.floating], step: int) -> NDArray[np.float64]:
    """Sums over blocks of texels, shape (blocks, channels)."""
    rows = np.add.reduceat(image.astype(np.float64), np.arange(0, image.shape[0], step), axis=0)
    blocks = np.add.reduceat(rows, np.arange(0, image.shape[1], step), axis=1)
    return np.asarray(blocks.reshape(-1, image.shape[2]))
