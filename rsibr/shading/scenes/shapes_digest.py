"""Digest of shapes as they are now: Mitsuba lets a user move their vertices in place, under the same addresses."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np


def shapes_digest(shapes: Iterable[mi.Shape]) -> str:
    """SHA-256 over places, normals and faces of shapes, without their materials.

    Parameters
    ----------
    shapes : iterable of mi.Shape
        Shapes. Values that a kernel has not computed yet are computed.

    Returns
    -------
    str
        Equal for equal shapes in equal order.
    """
    digest = hashlib.sha256()
    for shape in shapes:
        digest.update(shape.class_name().encode())
        values = mi.traverse(shape)
        for key in sorted(key for key in values.keys() if "." not in key):  # noqa: SIM118  # materials have dots
            digest.update(key.encode() + _bytes(values[key]))
    return digest.hexdigest()


def _bytes(value: Any) -> bytes:
    if dr.is_array_v(value):
        return np.ascontiguousarray(np.array(dr.detach(value))).tobytes()
    if hasattr(value, "matrix"):
        return np.array(dr.detach(value.matrix)).tobytes()
    return str(value).encode()
