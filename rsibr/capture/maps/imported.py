"""`rsibr.import_maps`: sphere maps of any other renderer become a bake."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

from rsibr import backend
from rsibr.capture.maps.photographed import seen_share
from rsibr.capture.maps.rectified import Rectification
from rsibr.capture.maps.spread import pixel_variance
from rsibr.capture.maps.stored import coverage_notes, require_resolution, stored
from rsibr.errors import InputError
from rsibr.geometry.frame import unit_view, view_frame
from rsibr.geometry.partial_views import GAP_DEG
from rsibr.geometry.projections.sphere_map import stored_coverage
from rsibr.geometry.viewpoints import partial_views
from rsibr.store.bake import Bake
from rsibr.store.manifest import CaptureRecord
from rsibr.store.map_file import MapFile

Array = NDArray[np.float64]

_ROTATION = 1e-4
_SAME_FRAME = 1e-6


@backend.in_session
def import_maps(
    maps: ArrayLike,
    views: ArrayLike,
    out: Path | str,
    *,
    variance: ArrayLike | None = None,
    coverage: ArrayLike | None = None,
    triangles: ArrayLike | None = None,
    compare_by: Rectification = "reflection",
    names: Sequence[str] = (),
    gap_deg: float = GAP_DEG,
    light: Path | str | None = None,
    fresh: bool = False,
) -> Bake:
    """Make a bake of sphere maps that another renderer made.

    Parameters
    ----------
    maps : array_like, shape (V, N, N, 3)
        Radiance [W sr⁻¹ m⁻²], row 0 at the top: the sphere in an orthographic view, filling the square.
    views : array_like, shape (V, 3) or (V, 3, 3)
        Direction from the sphere to the viewer of each map, whose x axis is then horizontal, as of
        `rsibr.geometry.frame.view_frame`; or its frame, columns right, up, and to the viewer.
    out : path
        `NAME.rsibr`.
    variance : array_like, shape (V, N, N, 3), optional
        Variance of the radiance; by default the spread of neighbouring texels, an upper bound.
    coverage : array_like, shape (V, N, N), optional
        Share of each texel that holds radiance, 0 to 1; by default its share of the disk.
    triangles : array_like, shape (M, 3), optional
        Views between which is interpolated, counter-clockwise seen from outside; by default those of the convex hull.
    compare_by : {"reflection", "normal"}
        How views are warped to each other and compared: glossy or matte.
    names : sequence of str, optional
        Of the maps, for messages.
    gap_deg : float
        Largest circumradius of three views that count as neighbours [degrees].
    light : path, optional
        Environment that lit the sphere.
    fresh : bool
        Whether a bake of other maps is replaced.

    Returns
    -------
    Bake

    Raises
    ------
    InputError
        If the arrays do not fit, or hold NaN, Inf or negative radiance where they are covered.
    BakeError, MachineError
        If it cannot be written.

    Examples
    --------
    >>> bake = rsibr.import_maps(radiance, views, "other.rsibr")          # doctest: +SKIP
    """
    images = _images(maps, "maps")
    count, resolution = images.shape[:2]
    require_resolution(resolution)
    frames = _frames(views, count)
    covered = _covered(coverage, count, resolution)
    spread = None if variance is None else _images(variance, "variance")
    if spread is not None and spread.shape != images.shape:
        raise InputError(
            f"of shape {spread.shape}, not {images.shape}", where="variance", fix="give one for each texel"
        )
    noise = np.stack([pixel_variance(image) for image in images]) if spread is None else spread
    made = [_map(*parts) for parts in zip(images, noise, covered, frames, strict=True)]
    viewpoints = partial_views(frames[:, :, 2], triangles, gap_deg=gap_deg)
    if names and len(names) != count:
        raise InputError(f"{len(names)} names for {count} maps", where="names", fix="give one for each")
    capture = CaptureRecord(
        source="import",
        names=tuple(names) or tuple(f"map {k}" for k in range(count)),
        distances=(None,) * count,
        rectified=compare_by,
        variance="spread" if spread is None else "given",
        seen=tuple(seen_share(one) for one in made),
        saturated=(0,) * count,
        gap_deg=gap_deg,
        is_partial=viewpoints.is_partial,
        notes=tuple(coverage_notes(viewpoints)),
    )
    return stored(Path(out), viewpoints, made, capture, light=None if light is None else Path(light), fresh=fresh)


def _images(values: ArrayLike, where: str) -> NDArray[np.float32]:
    try:
        found = np.asarray(values, dtype=np.float32)
    except (TypeError, ValueError):
        found = np.empty(0, dtype=np.float32)
    if found.ndim != 4 or found.shape[1] != found.shape[2] or found.shape[3] != 3 or not len(found):
        raise InputError(f"of shape {found.shape}", where=where, fix="give (V, N, N, 3)")
    return found


def _frames(views: ArrayLike, count: int) -> Array:
    found = np.asarray(views, dtype=np.float64)
    if found.shape == (count, 3):
        return np.stack([view_frame(unit_view(view)) for view in found])
    if found.shape != (count, 3, 3):
        raise InputError(f"of shape {found.shape} for {count} maps", where="views", fix="give (V, 3) or (V, 3, 3)")
    off = np.abs(np.swapaxes(found, 1, 2) @ found - np.eye(3)).max()
    if not off < _ROTATION or (np.linalg.det(found) < 0).any():
        raise InputError("a frame is no rotation", where="views", fix="give columns right, up, and to the viewer")
    return found


def _covered(coverage: ArrayLike | None, count: int, resolution: int) -> NDArray[np.float32]:
    disk = stored_coverage(resolution)
    if coverage is None:
        return np.repeat(disk[None], count, axis=0)
    found = np.asarray(coverage, dtype=np.float32)
    if found.shape != (count, resolution, resolution) or not ((found >= 0) & (found <= 1)).all():
        raise InputError(f"of shape {found.shape}, or out of range", where="coverage", fix="give (V, N, N), 0 to 1")
    return np.minimum(found, disk)


def _map(image: NDArray[np.float32], noise: NDArray[np.float32], covered: NDArray[np.float32], frame: Array) -> MapFile:
    """Map in the upright frame of its view."""
    seen = covered > 0
    sound = np.isfinite(image[seen]).all() and np.isfinite(noise[seen]).all()
    if not seen.any() or not sound or (image[seen] < 0).any() or (noise[seen] < 0).any():
        what = "a map shows nothing, or holds NaN, Inf or negative numbers where it is covered"
        raise InputError(what, where="maps", fix="give radiance and variance of 0 or more")
    image, noise = (np.where(seen[..., None], part, np.float32(0)) for part in (image, noise))
    upright = view_frame(frame[:, 2])
    if np.abs(upright - frame).max() > _SAME_FRAME:
        image, noise, covered = _turned(image, noise, covered, frame.T @ upright)
    return MapFile(upright[:, 2].copy(), upright, {"radiance": image}, noise, covered)


def _turned(
    image: NDArray[np.float32], noise: NDArray[np.float32], covered: NDArray[np.float32], turn: Array
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Turn a map about its view, by bilinear lookups; the variance is not lessened by them."""
    side = len(image)
    centre = (np.arange(side) + 0.5) * 2 / side - 1
    x, y = np.meshgrid(centre, -centre)
    from_x, from_y = turn[0, 0] * x + turn[0, 1] * y, turn[1, 0] * x + turn[1, 1] * y
    at = [(1 - from_y) * side / 2 - 0.5, (from_x + 1) * side / 2 - 0.5]
    seen = (covered > 0).astype(np.float64)
    weight = map_coordinates(seen, at, order=1, mode="nearest")
    shown = weight > 0.5

    def looked_up(part: NDArray[np.float32]) -> NDArray[np.float32]:
        channels = [map_coordinates(part[..., k] * seen, at, order=1, mode="nearest") for k in range(3)]
        mean = np.stack(channels, axis=-1) / np.maximum(weight, 1e-6)[..., None]
        return np.where(shown[..., None], mean, 0).astype(np.float32)

    whole = np.abs(covered - stored_coverage(side)).max() < _SAME_FRAME
    share = stored_coverage(side) if whole else np.minimum(stored_coverage(side), weight.astype(np.float32))
    share = np.where(shown, share, np.float32(0))
    return looked_up(image), looked_up(noise), share
