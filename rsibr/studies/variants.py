"""Variants of reconstruction: another warp, other weights, maps of another precision."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.methods.method_set import MethodSet
from rsibr.methods.protocol import Method
from rsibr.store.described_maps import AlteredMaps
from rsibr.store.health import LARGEST_HALF
from rsibr.store.map_file import MapFile
from rsibr.store.stored_maps import StoredMaps
from rsibr.studies.agenda import Variant, own_weights
from rsibr.studies.axes import mesh_of


def half_maps(bake: StoredMaps) -> AlteredMaps:
    """A bake with radiance rounded to float16 and clamped to the largest finite half.

    The error is that of half floats; time and bytes are not, because kernels read the format of all maps.
    """

    def rounded(_index: int, stored: MapFile) -> MapFile:
        return replace(stored, layers={name: _half(image) for name, image in stored.layers.items()})

    return AlteredMaps.of(bake, rounded)


def opened_at(bake: StoredMaps, precision: str) -> StoredMaps:
    """Return the bake with its maps at a precision, "float32" or "float16"."""
    return half_maps(bake) if precision == "float16" else bake


def variant_of(methods: MethodSet, variant: Variant) -> Method:
    """Make the method of a variant; its precision is that of the opened bake."""
    options: dict[str, Any] = {}
    if variant.weights != own_weights(variant.method):
        options["weights"] = variant.weights
    if (mesh := mesh_of(variant.warp)) is not None:
        options["mesh"] = mesh
    return methods.variant(variant.method, **options) if options else methods[variant.method]


def _half(image: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.clip(image, -LARGEST_HALF, LARGEST_HALF).astype(np.float16).astype(np.float32)
