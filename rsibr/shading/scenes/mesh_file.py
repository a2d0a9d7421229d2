"""Shapes from mesh files: PLY, OBJ, glTF and STL, read by trimesh.

Only geometry is read: positions, faces, vertex normals, names, and the transforms of a scene graph. Of the files that a
mesh file names, only the buffers of a glTF are opened, and only below its own folder; materials and textures are not.
"""

from __future__ import annotations

import logging
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from rsibr import machine
from rsibr.errors import InputError, MachineError
from rsibr.job_size import in_bytes
from rsibr.regular_file import read_regular
from rsibr.shading.scenes.mesh_repair import TriangleMesh, repaired
from rsibr.shading.scenes.unique_name import unique_name

SUFFIXES = (".ply", ".obj", ".gltf", ".glb", ".stl")
"""Suffixes of the mesh files that are read, in lower case."""

_MEMORY_PER_BYTE = {".ply": 25, ".obj": 25, ".gltf": 25, ".glb": 25, ".stl": 13}
"""Memory at the peak of reading and repair, over the size of the file."""

_NAMELESS = re.compile(r"(geometry(_\d+)?)?")  # what trimesh calls a part without a name
_LINES = re.compile(r"^(o|usemtl)[ \t]+(.*?)[ \t\r]*$", re.MULTILINE)


def load_meshes(path: Path) -> tuple[dict[str, mi.Mesh], tuple[str, ...]]:
    """Load the shapes of a mesh file in the current variant.

    Vertex normals are those of the file where it has any, otherwise smooth across edges of at most 40°; see
    `rsibr.shading.scenes.mesh_repair.repaired`.

    Parameters
    ----------
    path : Path
        File whose name ends in one of `SUFFIXES`.

    Returns
    -------
    shapes : dict of str to mi.Mesh
        Shapes by id: the names of the geometries, for an OBJ those of objects (`o`) and materials (`usemtl`). A
        geometry that a scene graph holds several times gives several shapes, the further ones with a number.
    notes : tuple of str
        What was repaired, in a sentence each.

    Raises
    ------
    InputError
        If the file does not exist, is no mesh of its format, or holds no triangle with an area.
    MachineError
        If it does not fit into the memory.
    """
    where = str(path)
    content = _content(path)
    _require_memory(path, len(content))
    shapes: dict[str, mi.Mesh] = {}
    notes: list[str] = []
    empty = 0
    for name, mesh in _triangle_meshes(path, content):
        try:
            whole, said = repaired(mesh, name, where)
        except InputError:
            if len(mesh.faces) and mesh.faces.max() >= len(mesh.vertices):
                raise
            empty += 1
            continue
        shapes[name] = as_shape(whole, name)
        notes += said
    if not shapes:
        raise InputError("it holds no triangle with an area", where=where, fix="give a mesh with surfaces")
    if empty:
        notes.append(f"{empty} part{'s' * (empty > 1)} of the file without a surface: left out")
    return shapes, tuple(notes)


def as_shape(mesh: TriangleMesh, name: str) -> mi.Mesh:
    """Put a mesh on the device, in the current variant.

    Parameters
    ----------
    mesh : TriangleMesh
        Triangles; their normals are taken as they are.
    name : str
        Shape id.
    """
    has_normals = mesh.normals is not None
    shape = mi.Mesh(name, len(mesh.vertices), len(mesh.faces), has_vertex_normals=has_normals)
    values = mi.traverse(shape)
    values["vertex_positions"] = mi.Float(np.ascontiguousarray(mesh.vertices, np.float32).ravel())
    values["faces"] = mi.UInt32(np.ascontiguousarray(mesh.faces, np.uint32).ravel())
    if mesh.normals is not None:
        values["vertex_normals"] = mi.Float(np.ascontiguousarray(mesh.normals, np.float32).ravel())
    values.update()
    shape.set_id(name)
    return shape


def _content(path: Path) -> bytes:
    try:
        return read_regular(path)
    except FileNotFoundError:
        raise InputError("there is no such file", where=str(path), fix="check the path") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), fix="name a mesh file") from None


def _require_memory(path: Path, size: int) -> None:
    needed, free = size * _MEMORY_PER_BYTE[path.suffix.lower()], machine.memory().available
    if free is not None and needed > free:
        what = (
            f"a mesh file of {in_bytes(size)} takes about {in_bytes(needed)} of memory, and {in_bytes(free)} are free"
        )
        raise MachineError(what, where=str(path), fix="give a mesh with fewer triangles")


def _triangle_meshes(path: Path, content: bytes) -> Iterator[tuple[str, TriangleMesh]]:
    """Names and meshes of a file in world coordinates."""
    import trimesh  # noqa: PLC0415  # half a second

    scene, names = _parsed(path, content)
    taken: set[str] = set()
    nodes = list(scene.graph.nodes_geometry)
    for node in reversed(nodes) if path.suffix.lower() == ".obj" else nodes:  # in the order of the file
        matrix, key = scene.graph[node]
        geometry = scene.geometry[key]
        if isinstance(geometry, trimesh.Trimesh):
            vertices, faces = geometry.vertices.view(np.ndarray), geometry.faces.view(np.ndarray)
            if {vertices.shape[1:], faces.shape[1:]} != {(3,)}:
                raise _damaged(path)
            given = geometry.vertex_normals if "vertex_normals" in geometry._cache else None
            mesh = TriangleMesh(vertices, faces, given if given is not None and given.shape == vertices.shape else None)
            name = unique_name(names.get(key, key), taken)
            taken.add(name)
            yield name, _transformed(mesh, np.asarray(matrix, np.float64))


def _parsed(path: Path, content: bytes) -> tuple[Any, dict[str, str]]:
    """Scene of trimesh, and the names of its geometries where they are not its keys."""
    import trimesh  # noqa: PLC0415

    kind = path.suffix.lower()[1:]
    options: dict[str, Any] = {"skip_materials": True}
    parts: dict[str, tuple[str, str]] = {}
    resolver: Any = _BelowFolder(path)
    if kind == "obj":
        content, materials, parts = _split_by_material(content)
        resolver, options = {"materials": materials}, {"split_objects": True}
    if kind == "stl":
        options = {}
    try:
        with warnings.catch_warnings(), _quiet():
            warnings.simplefilter("ignore")
            stream = trimesh.util.wrap_as_stream(content)
            scene = trimesh.load_scene(stream, file_type=kind, resolver=resolver, process=False, **options)
    except InputError:
        raise
    except MemoryError:
        raise MachineError("does not fit into the memory", where=str(path), fix="give a smaller mesh") from None
    except Exception as error:  # parsers raise all kinds on damaged files, with messages for programmers
        if refused := getattr(resolver, "refused", None):
            raise refused from None
        raise _damaged(path, f": {error}" if isinstance(error, NotImplementedError) else "") from None
    unnamed = {key: path.stem for key in scene.geometry if kind in ("ply", "stl") or _NAMELESS.fullmatch(key)}
    return scene, unnamed | _obj_names(scene.geometry, parts)


def _damaged(path: Path, reason: str = "") -> InputError:
    what = f"it is no {path.suffix[1:].upper()} file that can be read, or damaged{reason}"
    return InputError(what, where=str(path), fix="export it anew")


class _quiet:  # noqa: N801  # named like the context managers of contextlib
    """Context manager that silences trimesh's log."""

    def __enter__(self) -> None:
        self._was = logging.getLogger("trimesh").disabled
        logging.getLogger("trimesh").disabled = True

    def __exit__(self, *_: object) -> None:
        logging.getLogger("trimesh").disabled = self._was


@dataclass
class _BelowFolder:
    """Resolver of trimesh that opens regular files below the folder of a mesh file only.

    trimesh may swallow what `get` raises, so that it is kept.
    """

    path: Path
    refused: InputError | None = None

    def get(self, name: str) -> bytes:
        folder, where = self.path.resolve().parent, str(self.path)
        if name == "model.gltf":  # what trimesh asks for if a glTF is no JSON
            raise _damaged(self.path)
        try:
            place = (folder / name).resolve()
            if not place.is_relative_to(folder):
                what = f"names the file '{name}' outside its folder"
                self.refused = InputError(what, where=where, fix="put it beside the mesh, or export one file (.glb)")
                raise self.refused
            return read_regular(place)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "no file name"
            self.refused = InputError(
                f"names the file '{name[:80]}': {reason}", where=where, fix="put it beside the mesh"
            )
            raise self.refused from None

    __getitem__ = get

    def keys(self) -> tuple[str, ...]:
        return ()

    def namespaced(self, _: str) -> _BelowFolder:
        return self


def _split_by_material(content: bytes) -> tuple[bytes, bytes, dict[str, tuple[str, str]]]:
    """OBJ that trimesh splits by object and material, a library of its materials, and object and material by part.

    The library holds names only. No file is opened for it: trimesh takes materials apart only if it finds them.
    """
    text = content.decode("utf-8", errors="replace")
    lines = _LINES.findall(text)
    materials = list(dict.fromkeys(name for kind, name in lines if kind == "usemtl"))
    parts: dict[str, tuple[str, str]] = {}
    one, of = "", ""
    for kind, name in lines:
        one, of = (name, of) if kind == "o" else (one, name)
        parts["_".join(filter(None, (one, of if len(materials) > 1 else "")))] = one, of
    library = "".join(f"newmtl {name}\n" for name in materials)
    without = re.sub(r"^mtllib.*$", "", text, flags=re.MULTILINE)
    return f"mtllib materials\n{without}".encode(), library.encode(), parts


def _obj_names(keys: Iterable[str], parts: dict[str, tuple[str, str]]) -> dict[str, str]:
    """Names of the parts of an OBJ: object, material, or both where an object has several materials."""
    by_name = {key: "" if _NAMELESS.fullmatch(key) else key for key in keys}
    present = {key: parts[name] for key, name in by_name.items() if any(parts.get(name, ()))}
    by_object = Counter(one for one, _ in present.values())
    names = {}
    for key, (one, of) in present.items():
        is_one_object = len(by_object) == 1 and of
        names[key] = of if is_one_object else one if by_object[one] == 1 else f"{one}-{of}".strip("-")
    return names


def _transformed(mesh: TriangleMesh, matrix: np.ndarray) -> TriangleMesh:
    """Mesh in world coordinates; a mirroring transform turns the windings, so that they stay outward."""
    if np.array_equal(matrix, np.eye(4)):
        return mesh
    linear = matrix[:3, :3]
    is_mirrored = np.linalg.det(linear) < 0
    faces = mesh.faces[:, ::-1] if is_mirrored else mesh.faces
    normals = mesh.normals
    if (
        normals is not None
    ):  # the cofactors: the inverse transpose but for a positive factor, and defined without an inverse
        a, b, c = linear
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
        normals = normals @ cofactors.T * (-1 if is_mirrored else 1)
        scale = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(scale > 0, scale, 1)
    return TriangleMesh(mesh.vertices @ linear.T + matrix[:3, 3], faces, normals)
