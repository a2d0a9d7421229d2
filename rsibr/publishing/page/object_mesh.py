"""The object of a page: triangles by bake, quantised to 16 bits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr.errors import InputError
from rsibr.publishing.bundle.encoding import Encoded, encoded
from rsibr.shading.scenes.mesh_repair import TriangleMesh
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.scenes.triangles import triangle_meshes

MOST_TRIANGLES = 1_000_000
"""Triangles that a page takes unless it is told to: some 10 MiB of HTML."""

_LARGEST = 32767


@dataclass(frozen=True, eq=False)
class ObjectMesh:
    """Triangles of an object, those of a bake together.

    Attributes
    ----------
    meta : dict
        As the page's JSON holds it: `lowest` and `extent` of the bounding box; `parts` with the number of the bake (−1
        without one), the first index and the count of indices; `triangles`, their number.
    arrays : dict of str to Encoded
        `positions`, shape (3, V): −32767 to 32767 over the bounding box; `normals`, shape (3, V), over −1 to 1;
        `faces`: indices, each less the one before it.
    """

    meta: dict[str, Any]
    arrays: dict[str, Encoded]


def object_mesh(scene: ObjectScene, bake_of: Mapping[str, int], *, allow_large: bool = False) -> ObjectMesh:
    """Triangles of a scene for a page.

    Parameters
    ----------
    scene : ObjectScene
        Shapes.
    bake_of : mapping of str to int
        Number of the bake of each shape that has one, by shape id.
    allow_large : bool
        Take more than `MOST_TRIANGLES`.

    Raises
    ------
    InputError
        If a shape has no triangles, or there are too many.
    """
    meshes = triangle_meshes(scene)
    total = sum(len(mesh.faces) for mesh in meshes.values())
    if total > MOST_TRIANGLES and not allow_large:
        fix = "give a coarser mesh, or --yes (allow_large=True)"
        what = f"{total} triangles are more than a page is meant for ({MOST_TRIANGLES})"
        raise InputError(what, where=scene.name, fix=fix)
    lowest, highest = scene.bounds
    extent = np.maximum(highest - lowest, 1e-30)
    ordered = sorted(meshes, key=lambda name: bake_of.get(name, -1))
    return ObjectMesh(
        {
            "lowest": lowest.tolist(),
            "extent": extent.tolist(),
            "parts": _parts(ordered, meshes, bake_of),
            "triangles": total,
        },
        _arrays([meshes[name] for name in ordered], lowest, extent),
    )


def _parts(ordered: list[str], meshes: Mapping[str, TriangleMesh], bake_of: Mapping[str, int]) -> list[dict[str, int]]:
    parts: list[dict[str, int]] = []
    for name in ordered:
        bake, count = bake_of.get(name, -1), 3 * len(meshes[name].faces)
        if parts and parts[-1]["bake"] == bake:
            parts[-1]["count"] += count
        else:
            first = parts[-1]["first"] + parts[-1]["count"] if parts else 0
            parts.append({"bake": bake, "first": first, "count": count})
    return parts


def _arrays(meshes: list[TriangleMesh], lowest: NDArray[np.float64], extent: NDArray[np.float64]) -> dict[str, Encoded]:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)])
    place = 2 * (np.concatenate([mesh.vertices for mesh in meshes]) - lowest) / extent - 1
    normals = np.concatenate([np.zeros_like(m.vertices) if m.normals is None else m.normals for m in meshes])
    steps = np.diff(faces.ravel().astype(np.uint32), prepend=np.uint32(0))  # modulo 2³²
    return {"positions": _quantised(place), "normals": _quantised(normals), "faces": encoded(steps)}


def _quantised(values: NDArray[np.float64]) -> Encoded:
    whole = np.rint(np.clip(np.nan_to_num(values), -1, 1) * _LARGEST).astype(np.int16)
    return encoded(np.ascontiguousarray(whole.T))
