"""Writes `scenes/materials/hazy-bronze.bsdf`: a synthetic material in the file format of Mitsuba's plugin `measured`.

Its microfacet normals are a mixture of two GGX distributions, a sharp core in a wide haze: longer tails than either
distribution has that Mitsuba names. Masking is Smith's (Heitz 2014, *Understanding the Masking-Shadowing Function*),
from the projected area that the file holds in any case. The format is that of Dupuy & Jakob (2018), *An Adaptive
Parameterization for Efficient Material Acquisition and Rendering*, with a uniform `vndf`, so that places of the tables
are microfacet normals themselves.

    python scripts/measured_bsdf.py [FILE]
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FILE = Path(__file__).parents[1] / "scenes" / "materials" / "hazy-bronze.bsdf"

LOBES = ((0.6, 0.08), (0.4, 0.4))
"""Share and α of each GGX distribution."""

F0 = np.array([0.75, 0.5, 0.25])
"""Reflectance at normal incidence; Schlick (1994) beyond it."""

SIDE = 24
"""Nodes a side of the tables over microfacet normals."""

VIEWS = 12
"""Angles of incidence from 0 to 90°."""

FINE = 256
"""Nodes of the tables of one angle."""

SEEN = 1e-4
"""Least density of sampling, relative to the largest: no light that the table misses is lost."""

_TYPES = {np.dtype(np.uint8): 1, np.dtype(np.float32): 10}

Array = NDArray[np.float64]


def normal_distribution(cosine: Array) -> Array:
    """Density D(m) of microfacet normals [sr⁻¹]; ∫ D cos θ dω = 1."""
    squares = ((share, alpha**2) for share, alpha in LOBES)
    return np.sum([share * a2 / (np.pi * ((a2 - 1) * cosine**2 + 1) ** 2) for share, a2 in squares], axis=0)


def projected_area(cosine: Array) -> Array:
    """Area σ(i) = ∫ D(m) max(i·m, 0) dm of the microfacets that face a direction; of each GGX in closed form."""
    roots = [share * np.sqrt(cosine**2 + alpha**2 * (1 - cosine**2)) for share, alpha in LOBES]
    return (cosine + np.sum(roots, axis=0)) / 2


def masking(cosine: Array) -> Array:
    """Smith's G₁ = cos θ / σ(θ); 0 below the horizon."""
    return np.maximum(cosine, 0) / projected_area(np.maximum(cosine, 0))


def reflectance(cosine: Array) -> Array:
    """Fresnel reflectance by the cosine to the microfacet; shape (..., 3)."""
    return F0 + (1 - F0) * ((1 - np.clip(cosine, 0, 1)) ** 5)[..., None]


def fields() -> dict[str, NDArray[np.generic]]:
    """All fields of the file. With the jacobian, Mitsuba's f cos θ_o = rgb · ndf / (4 sigma), hence rgb = F · G₁(o)."""
    unit, incident = np.linspace(0, 1, SIDE), np.linspace(0, np.pi / 2, VIEWS)
    u, v = np.meshgrid(unit, unit)
    theta, phi = (u**2 * np.pi / 2)[None], ((2 * v - 1) * np.pi)[None]
    angle = incident[:, None, None]
    dot = np.cos(angle) * np.cos(theta) + np.sin(angle) * np.sin(theta) * np.cos(phi)
    outgoing = 2 * dot * np.cos(theta) - np.cos(angle)
    rgb = reflectance(dot) * (masking(outgoing) * (dot > 0))[..., None]
    # ---- Density of sampling over (u, v): the value, times the solid angle of directions that a normal stands for ----
    solid = 2 * np.pi**2 * u * np.sin(theta) * 4 * np.maximum(dot, 0)
    density = rgb.mean(axis=-1) * normal_distribution(np.cos(theta)) / (4 * projected_area(np.cos(angle))) * solid
    fine = np.cos(np.linspace(0, 1, FINE) ** 2 * np.pi / 2)
    return {
        "description": np.frombuffer(b"synthetic: two GGX distributions, a core in a haze", np.uint8),
        "jacobian": np.ones(1, np.uint8),
        "phi_i": np.zeros(1, np.float32),
        "theta_i": incident.astype(np.float32),
        "ndf": np.tile(normal_distribution(fine), (2, 1)).astype(np.float32),
        "sigma": np.tile(projected_area(fine), (2, 1)).astype(np.float32),
        "vndf": np.ones((1, VIEWS, 2, 2), np.float32),
        "luminance": np.maximum(density, SEEN * density.max()).astype(np.float32)[None],
        "rgb": np.moveaxis(rgb, -1, 1).astype(np.float32)[None],
    }


def tensor_file(content: Mapping[str, NDArray[np.generic]]) -> bytes:
    """Encode fields as Mitsuba's tensor file: a header that names type, shape and place of each, then the data."""
    lengths = [2 + len(name) + 2 + 1 + 8 + 8 * array.ndim for name, array in content.items()]
    head, data = struct.pack("<12s2BI", b"tensor_file\0", 1, 0, len(content)), b""
    start = len(head) + sum(lengths)
    for name, array in content.items():
        place = start + len(data)
        head += struct.pack(f"<H{len(name)}sHBQ", len(name), name.encode(), array.ndim, _TYPES[array.dtype], place)
        head += struct.pack(f"<{array.ndim}Q", *array.shape)
        data += array.tobytes()
        data += bytes(-len(data) % 8)
    return head + data


if __name__ == "__main__":
    Path(sys.argv[1] if len(sys.argv) > 1 else FILE).write_bytes(tensor_file(fields()))
