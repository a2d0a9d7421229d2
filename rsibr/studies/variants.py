"""A picture in every way that a study asks for: another warp, other weights, maps of another precision."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rsibr.geometry.spherical import area_weights, gnomonic_weights
from rsibr.methods.protocol import MeshMethod, Method
from rsibr.methods.registry import MethodSet
from rsibr.methods.rsibr.residual_method import ResidualMethod
from rsibr.methods.warp_blend.blend import triangle_mix
from rsibr.store.health import LARGEST_HALF
from rsibr.store.map_file import MapFile
from rsibr.store.stored_maps import AlteredMaps, StoredMaps
from rsibr.studies.agenda import OWN_WEIGHTS, Variant
from rsibr.studies.axes import mesh_of

_WEIGHTS = {"area": area_weights, "gnomonic": gnomonic_weights}
_FLOAT_BYTES = {"float32": 4, "float16": 2}


def half_maps(bake: StoredMaps) -> AlteredMaps:
    """A bake whose radiance is rounded to float16; what exceeds the largest half is held at it.

    The kernels still read float32: error and bytes are those of half floats, the time is not.
    """

    def rounded(_index: int, stored: MapFile) -> MapFile:
        return replace(stored, layers={name: _half(image) for name, image in stored.layers.items()})

    return AlteredMaps.of(bake, rounded)


def opened_at(bake: StoredMaps, precision: str) -> StoredMaps:
    """Return the bake with its maps at a precision, "float32" or "float16"."""
    return half_maps(bake) if precision == "float16" else bake


def variant_of(methods: MethodSet, variant: Variant) -> Method:
    """Make the method of a variant from a bake's methods; its precision is a matter of how the bake was opened."""
    method = methods[variant.method]
    if variant.weights in _WEIGHTS and variant.weights != OWN_WEIGHTS[variant.method]:
        method = replace(method, mix=triangle_mix(_WEIGHTS[variant.weights]))
    mesh = mesh_of(variant.warp)
    if mesh is None:
        return method
    name, cost = method.name, method.cost
    return MeshMethod(name, method.viewpoints, method.sources, method.mix, method.warp, cost, mesh=mesh)


def bytes_read(bake: StoredMaps, method: Method, precision: str) -> int:
    """Size of what a method reads [bytes], in memory: three channels a texel of each map, and the light if it does."""
    maps = 3 * _FLOAT_BYTES[precision] * bake.view_count * bake.resolution**2
    return maps + bake.light.nbytes if isinstance(method, ResidualMethod) else maps


def _half(image: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.clip(image, -LARGEST_HALF, LARGEST_HALF).astype(np.float16).astype(np.float32)
