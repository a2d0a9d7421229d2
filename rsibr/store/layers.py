"""Layers of the map of a view: one for each lobe, or one for several lobes that need no further views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsibr.store.manifest import LobeRecord
from rsibr.store.map_file import WHOLE, MapFile

REST = "rest"
"""Name of the layer that holds the sum of the lobes without a layer of their own, if others have one."""


def layers_at(lobes: Sequence[LobeRecord], index: int) -> dict[str, list[str]]:
    """Layers of the view `index`, each with the names of its lobes, in the order of the map.

    Parameters
    ----------
    lobes : sequence of LobeRecord
        Lobes of the manifest.
    index : int
        Index of the view.
    """
    done = [lobe.name for lobe in lobes if lobe.views is not None and index >= lobe.views]
    if len(lobes) < 2 or len(done) == len(lobes):
        return {WHOLE: [lobe.name for lobe in lobes]}
    added_up = done if len(done) > 1 else []  # a single lobe keeps its own layer
    layers: dict[str, list[str]] = {}
    for lobe in lobes:
        layers.setdefault(REST if lobe.name in added_up else lobe.name, []).append(lobe.name)
    return layers


def layer_of(lobe: str, lobes: Sequence[LobeRecord]) -> str:
    """Layer of a lobe in the views that store it separately; a single lobe is the layer `WHOLE`."""
    return lobe if len(lobes) > 1 else WHOLE


def layered(map_file: MapFile, lobes: Sequence[LobeRecord], index: int) -> MapFile:
    """Return the map with the layers of the view `index`.

    Parameters
    ----------
    map_file : MapFile
        Map with a layer for each lobe.
    lobes, index
        See `layers_at`.

    Returns
    -------
    MapFile
        Lobes without a layer of their own are added in their order, in float32. If they come first, as the widest lobes
        do, the sum of all layers is bit-identical.
    """
    parts = layers_at(lobes, index)
    if len(parts) == len(map_file.layers):
        return map_file
    images = {
        name: np.asarray(np.sum([map_file.layers[member] for member in members], axis=0, dtype=np.float32))
        for name, members in parts.items()
    }
    return replace(map_file, layers=images)
