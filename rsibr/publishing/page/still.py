"""Exposure of a page, and the still picture that stands where WebGL2 is missing."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rsibr.store.bake import Bake
from rsibr.store.map_file import MapFile
from rsibr.store.png_file import exposure_of, tone_mapped
from rsibr.validation.report.pictures import data_uri, shrunk

_MOST_MAPS = 12
_SIDE = 128


def exposure(bakes: list[Bake]) -> float:
    """Factor on radiance, at which the maps of all bakes are neither dark nor washed out."""
    brightest = []
    for bake in bakes:
        for index in np.linspace(0, bake.view_count - 1, min(bake.view_count, _MOST_MAPS)).astype(int):
            one = bake.map(int(index))
            brightest.append(one.radiance[one.coverage >= 0.5].max(axis=-1))
    return exposure_of(np.concatenate(brightest))


def nearest_map(bake: Bake, view: ArrayLike) -> MapFile:
    """Stored map whose view is nearest to a direction."""
    return bake.map(int(np.argmax(bake.directions @ np.asarray(view, np.float64))))


def picture_uri(stored: MapFile, factor: float) -> str:
    """Small PNG of a map as a data URI."""
    return data_uri(shrunk(tone_mapped(stored.radiance, stored.coverage, factor), _SIDE))
