"""`rsibr capture light`: lamps are added to an environment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from rsibr import backend
from rsibr.capture.lamps.lamp import Lamp, near_note
from rsibr.capture.panorama import Panorama
from rsibr.errors import InputError
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment

_LEAST_HEIGHT = 2  # a row at each pole


@backend.in_session
def capture_light(environment: Path | str | EnvironmentConfig, lamps: Sequence[Lamp]) -> Panorama:
    """Add lamps to an environment, with their energy and direction.

    Parameters
    ----------
    environment : path or EnvironmentConfig
        Latitude–longitude map.
    lamps : sequence of Lamp
        At least one; see `rsibr.capture.lamps.lamp` for lamps at a place.

    Raises
    ------
    InputError
        If the environment is no map or has a single row, there are no lamps, or one is too bright to be stored.
    """
    if not lamps:
        raise InputError("no lamps", where="lamps", fix="give --point, --directional or --disc")
    config = environment if isinstance(environment, EnvironmentConfig) else EnvironmentConfig(file=Path(environment))
    loaded = load_environment(config)
    if loaded.image is None:
        raise InputError("is no map", where=loaded.name, fix="give an OpenEXR or Radiance HDR file")
    height, width = loaded.image.shape[:2]
    if height < _LEAST_HEIGHT:
        what = f"its {width} × {height} texels are too few to place a lamp"
        raise InputError(what, where=loaded.name, fix=f"give a map of {_LEAST_HEIGHT} rows or more")
    lit = loaded.image
    for lamp in lamps:
        with np.errstate(over="ignore"):
            lit = lamp.added_to(lit)
        if not np.isfinite(lit).all():
            what = f"an irradiance of {', '.join(f'{value:g}' for value in lamp.irradiance)} on these texels"
            raise InputError(what, where="lamps", fix="give less: radiance beyond 3e38 cannot be stored")
    kinds = f"{len(lamps)} lamp{'s' if len(lamps) > 1 else ''}"
    return Panorama(lit, f"{loaded.name} with {kinds} added", loaded.notes)


def lamp_notes(positions: Sequence[ArrayLike], radius: float) -> tuple[str, ...]:
    """Warnings on lamps at places too near to an object of this radius about the origin.

    Raises
    ------
    InputError
        If the radius is not positive.
    """
    if not (math.isfinite(radius) and radius > 0):
        raise InputError(f"a radius of {radius:g}", where="object_radius", fix="give a positive number")
    distances = [math.hypot(*np.asarray(one, dtype=np.float64)) for one in positions]
    return tuple(note for one in distances if (note := near_note(one, radius)) is not None)
