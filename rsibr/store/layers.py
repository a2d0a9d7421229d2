"""Which layers the map of a view has: a lobe each, or several lobes that need no more views, added up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsibr.store.manifest import LobeRecord
from rsibr.store.map_file import MapFile

WHOLE = "radiance"
"""The one layer of a map that keeps no lobes apart."""

REST = "rest"
"""The layer of all lobes that a view does not keep apart, where it does others."""


def layers_at(lobes: Sequence[LobeRecord], index: int) -> dict[str, list[str]]:
    """Layers of the view `index`, each with the names of the lobes in it, in the order of the map.

    Parameters
    ----------
    lobes : sequence of LobeRecord
        Of the manifest.
    index : int
        Place of the view among the stored ones.
    """
    done = [lobe.name for lobe in lobes if lobe.views is not None and index >= lobe.views]
    if len(lobes) < 2 or len(done) == len(lobes):
        return {WHOLE: [lobe.name for lobe in lobes]}
    added_up = done if len(done) > 1 else []  # one alone is the layer that it was
    layers: dict[str, list[str]] = {}
    for lobe in lobes:
        layers.setdefault(REST if lobe.name in added_up else lobe.name, []).append(lobe.name)
    return layers


def layer_of(lobe: str, lobes: Sequence[LobeRecord]) -> str:
    """Layer of a lobe in the views that keep it apart: a lone one is not told apart from the whole."""
    return lobe if len(lobes) > 1 else WHOLE


def layered(map_file: MapFile, lobes: Sequence[LobeRecord], index: int) -> MapFile:
    """Return the map with the layers of the view `index`.

    Parameters
    ----------
    map_file : MapFile
        With a layer for each lobe.
    lobes, index
        See `layers_at`.

    Returns
    -------
    MapFile
        Lobes that are not kept apart are added up in their order, in float32. Where they come first, as the widest
        lobes do, the sum of all layers keeps its very bits.
    """
    parts = layers_at(lobes, index)
    if len(parts) == len(map_file.layers):
        return map_file
    images = {
        name: np.asarray(np.sum([map_file.layers[member] for member in members], axis=0, dtype=np.float32))
        for name, members in parts.items()
    }
    return replace(map_file, layers=images)
