"""Pictures of maps with one exposure for all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsibr.store.map_file import MapFile
from rsibr.store.png_file import Rgba, exposure_of, tone_mapped


def of_maps(maps: Sequence[MapFile]) -> list[Rgba]:
    """Tone-mapped pictures of maps, comparable among each other."""
    brightest = np.concatenate([one.radiance[one.coverage >= 0.5].max(axis=-1) for one in maps])
    exposure = exposure_of(brightest)
    return [tone_mapped(one.radiance, one.coverage, exposure) for one in maps]
