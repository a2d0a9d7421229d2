"""Pictures of a scene through a pinhole camera, rendered by Mitsuba: linear radiance, no camera's curve yet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.capture.cameras.mitsuba_sensor import sensor_of
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.errors import InputError

MOST_RAYS = 2**28
"""Largest number of rays of one launch."""


@backend.in_session
def rendered(
    things: Mapping[str, Any], camera: Pinhole, *, samples: int = 64, seed: int = 0, depth: int = -1
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Render what a camera sees; a pixel is the mean over its area.

    Parameters
    ----------
    things : mapping
        Shapes and emitters of a Mitsuba scene, by name, as plain data or objects.
    camera : Pinhole
        With square pixels.
    samples : int
        Rays a pixel.
    seed : int
        Of the rays.
    depth : int
        Longest path; −1: no limit.

    Returns
    -------
    radiance : ndarray, shape (H, W, 3)
        Scene-linear; emitters at infinity are seen where no shape is.
    alpha : ndarray, shape (H, W)
        Share of each pixel that shapes cover.

    Raises
    ------
    InputError
        If the pixels are not square, or the picture is too large for one launch.
    """
    if camera.width * camera.height * samples > MOST_RAYS:
        fix = "ask for fewer pixels or samples"
        raise InputError(f"more than {MOST_RAYS} rays in one picture", where="camera", fix=fix)
    integrator = {"type": "path", "max_depth": depth}
    scene = {"type": "scene", "integrator": integrator, "sensor": sensor_of(camera, samples), **things}
    shown = _rendered(scene, seed, samples)
    hidden = {"type": "path", "max_depth": depth, "hide_emitters": True}
    alpha = _rendered({**scene, "integrator": hidden}, seed, min(samples, 16))[..., 3]
    return shown[..., :3], np.ascontiguousarray(alpha)


def _rendered(scene: dict[str, Any], seed: int, samples: int) -> NDArray[np.float32]:
    return np.asarray(mi.render(backend.load(scene), seed=seed, spp=samples).numpy(), dtype=np.float32)
