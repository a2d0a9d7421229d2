"""Shapes of known form, and the truths of a camera over them, without a bake."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import mitsuba as mi
import numpy as np

from rsibr import backend
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.validation.objects.primary_rays import PrimaryRays
from rsibr.validation.objects.truths import ObjectTruths
from tests.validation.doubles import Sky


@dataclass(frozen=True)
class Coat:
    """A material from any Mitsuba BSDF dictionary, with the direction by which its map is indexed."""

    dictionary: dict
    warp: str = "mirror"

    def bsdf(self):
        return backend.load(dict(self.dictionary))


LAMBERT = Coat({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.5, 0.2]}}, "normal")
GLOSSY = Coat({"type": "roughplastic", "alpha": 0.2, "distribution": "ggx"})


def mesh(name, vertices, faces, normals=None):
    """Triangle mesh from arrays; without normals it is faceted."""
    made = mi.Mesh(name, len(vertices), len(faces), has_vertex_normals=normals is not None)
    parameters = mi.traverse(made)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    if normals is not None:
        parameters["vertex_normals"] = np.ravel(normals).astype(np.float32)
    parameters.update()
    return made


def bowl(rows=48, columns=96):
    """Lower half of the unit sphere, open at the top, with normals toward its inside."""
    polar, azimuth = np.meshgrid(
        np.linspace(np.pi / 2, np.pi, rows), np.linspace(0, 2 * np.pi, columns + 1), indexing="ij"
    )
    points = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.cos(polar), np.sin(polar) * np.sin(azimuth)], axis=-1
    ).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    quads = np.stack([corner, corner + 1, corner + columns + 2, corner + columns + 1], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return mesh("bowl", points, faces, -points)


def square(name, corner, across, along):
    """Parallelogram of two triangles; its normal is across × along."""
    corner, across, along = (np.array(one, dtype=float) for one in (corner, across, along))
    return mesh(name, [corner, corner + across, corner + across + along, corner + along], [[0, 1, 2], [0, 2, 3]])


def truths_of(shapes, camera: Camera, coat, sky: Sky, samples=512, rays=4, seed=1) -> ObjectTruths:
    """Truths of shapes that share one material."""
    scene = ObjectScene("test", shapes)
    bakes = {"*": SimpleNamespace(manifest=SimpleNamespace(identity={"environment": {"content": "sky"}}))}
    primary = PrimaryRays(scene, SurfaceTypes.assign(scene, ["*"]), camera, rays)
    return ObjectTruths(primary, bakes, [SimpleNamespace(environment=sky, material=coat)], samples, seed=seed)
