"""Objects with known occlusion, and inputs of a bake that was never made, for tests of occlusion."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import trimesh

from rsibr.light.radiance import Light
from rsibr.lobes.albedo import NODES
from rsibr.methods.inputs import MethodInputs
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.store.manifest import GaussianRecord, LobeRecord, ProxyRecord, ShapeRecord


def mesh_of(solid, name="object", smooth=True):
    """Mitsuba mesh of a trimesh, with vertex normals if it is smooth."""
    mesh = mi.Mesh(name, len(solid.vertices), len(solid.faces), has_vertex_normals=smooth)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.asarray(solid.vertices, np.float32).ravel()
    parameters["faces"] = np.asarray(solid.faces, np.uint32).ravel()
    if smooth:
        parameters["vertex_normals"] = np.asarray(solid.vertex_normals, np.float32).ravel()
    parameters.update()
    return mesh


def scene_of(**solids):
    """Scene of trimeshes by id."""
    return ObjectScene("test", {name: mesh_of(solid, name) for name, solid in solids.items()})


def torus():
    """A torus: its inner side sees itself."""
    return trimesh.creation.torus(1.0, 0.45, major_sections=48, minor_sections=24)


def constant_light(radiance=(1.0, 1.0, 1.0), resolution=32):
    """The same radiance from everywhere."""
    return Light(np.broadcast_to(np.float32(radiance), (resolution, resolution, 3)).copy())


def inputs_of(light, matte=0.5, gloss=0.0):
    """Inputs of a bake with a Lambertian lobe and a glossy one, of constant albedos; either may be absent (0)."""
    lobes, proxy = [], (ProxyRecord(alpha=0.0, coefficients=((1.0, 1.0, 1.0),)),)
    if matte:
        cosine = ShapeRecord(alpha=0.0, bare=(), coated=(), matte=((matte,) * 3, (0.0,) * 3))
        lobes.append(LobeRecord(name="diffuse", alpha=0.0, albedo=((matte,) * 3,) * NODES, proxies=proxy, shape=cosine))
    if gloss:
        narrow = GaussianRecord(sigma=0.05, plain=(gloss,) * 3, grazing=(0.0,) * 3)
        shiny = ShapeRecord(alpha=0.1, bare=(narrow,), coated=(), matte=((0.0,) * 3, (0.0,) * 3))
        lobes.append(LobeRecord(name="glossy", alpha=0.1, albedo=((gloss,) * 3,) * NODES, proxies=proxy, shape=shiny))
    manifest = SimpleNamespace(lobes=tuple(lobes), light=SimpleNamespace(delta_lights=0), plan=None)
    return MethodInputs(SimpleNamespace(manifest=manifest, light=light, view_count=0))
