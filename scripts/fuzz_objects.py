"""Mesh files and Mitsuba scenes, altered: a target each of `fuzz.py`."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import trimesh

from rsibr.shading.scenes.scene_file import open_scene

Case = Callable[[], object]

SCENE = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
<lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
<bsdf type="diffuse" id="mat"><rgb name="reflectance" value="0.5"/></bsdf>
<shape type="ply" id="part"><string name="filename" value="part.ply"/><ref id="mat"/></shape>
<shape type="shapegroup" id="g"><shape type="cube"/></shape>
<shape type="instance"><ref id="g"/><transform name="to_world"><translate x="3"/></transform></shape>
<shape type="sphere"><float name="radius" value="2"/><emitter type="area"/></shape>
<emitter type="constant"/>
</scene>
"""


class Objects:
    """Makes the inputs of the targets `mesh` and `scene`.

    Parameters
    ----------
    folder : Path
        Where the files are written.
    mutated : callable
        (random numbers, bytes) → altered bytes.
    """

    def __init__(self, folder: Path, mutated: Callable[[random.Random, bytes], bytes]) -> None:
        self.folder, self.mutated = folder, mutated
        ball = trimesh.creation.icosphere(1)
        assert ball.vertex_normals is not None  # so that they are exported
        exported = {kind: ball.export(file_type=kind) for kind in ("ply", "obj", "glb", "stl")}
        parts = b"o a\nusemtl x\nf 1 2 3\nusemtl y\nf 1/1/1 2/2/2 3/3/3 4//4\ng z\nf -1 -2 -3\n"
        self._whole = {
            kind: content if isinstance(content, bytes) else content.encode() for kind, content in exported.items()
        }
        self._whole["obj"] += parts
        self._whole["gltf"] = b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "part.ply", "byteLength": 99}]}'

    def targets(self) -> dict[str, Callable[[random.Random], Case]]:
        """Kinds of inputs by name."""
        return {"mesh": self.mesh, "scene": self.scene}

    def mesh(self, rng: random.Random) -> Case:
        """A mesh file, altered."""
        kind = rng.choice(list(self._whole))
        path = self.folder / f"mesh.{kind}"
        path.write_bytes(self.mutated(rng, self._whole[kind]))
        return lambda: open_scene(path).bounds

    def scene(self, rng: random.Random) -> Case:
        """A Mitsuba scene, or the mesh that it names, altered."""
        is_mesh = rng.random() < 0.4
        part, text = self._whole["ply"], SCENE.encode()
        (self.folder / "part.ply").write_bytes(self.mutated(rng, part) if is_mesh else part)
        path = self.folder / "scene.xml"
        path.write_bytes(text if is_mesh else self.mutated(rng, text))
        return lambda: open_scene(path).bounds
