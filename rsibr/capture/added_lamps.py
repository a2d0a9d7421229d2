"""`rsibr capture light`: lamps are added to an environment."""

from __future__ import annotations

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
        If the environment is no map, or there are no lamps.
    """
    if not lamps:
        raise InputError("no lamps", where="lamps", fix="give --point, --directional or --disc")
    config = environment if isinstance(environment, EnvironmentConfig) else EnvironmentConfig(file=Path(environment))
    loaded = load_environment(config)
    if loaded.image is None:
        raise InputError("is no map", where=loaded.name, fix="give an OpenEXR or Radiance HDR file")
    lit = loaded.image
    for lamp in lamps:
        lit = lamp.added_to(lit)
    kinds = f"{len(lamps)} lamp{'s' if len(lamps) > 1 else ''}"
    return Panorama(lit, f"{loaded.name} with {kinds} added", loaded.notes)


def lamp_notes(positions: Sequence[ArrayLike], radius: float) -> tuple[str, ...]:
    """Warnings on lamps at places too near to an object of this radius about the origin."""
    distances = [float(np.linalg.norm(np.asarray(one, dtype=np.float64))) for one in positions]
    return tuple(note for one in distances if (note := near_note(one, radius)) is not None)
