"""Self-occlusion: on for hollow dielectrics, off for convex objects and metals."""

import trimesh

from rsibr.shading.cameras.camera import Camera
from rsibr.shading.effects.evidence import Evidence, SceneEvidence
from rsibr.shading.effects.self_occlusion import self_occlusion
from rsibr.shading.surface_types import SurfaceTypes
from tests.shading.occlusion.objects import constant_light, inputs_of, scene_of, torus


def test_evidence_decides(evidence):
    hollow, convex = self_occlusion(evidence("torus")), self_occlusion(evidence("ball"))
    assert hollow.on
    assert hollow.evidence > hollow.threshold
    assert hollow.error_if_left_out > 1e-3
    assert not convex.on
    assert not convex.missed
    assert convex.error_if_left_out < 1e-5


def test_forced(evidence):
    off = self_occlusion(evidence("torus", switches={"self_occlusion": "off"}))
    assert not off.on
    assert off.missed
    assert off.error_if_left_out > 1e-3
    assert self_occlusion(evidence("ball", switches={"self_occlusion": "on"})).on


def test_metals_stay_open_and_are_told(evidence):
    for switch in ("auto", "on"):
        metal = self_occlusion(evidence("torus", matte=0.0, gloss=0.8, switches={"self_occlusion": switch}))
        assert not metal.on
        assert metal.missed
        assert metal.why.startswith("metal ")


def test_shapes_without_a_bake_are_told():
    ball = trimesh.creation.icosphere(2, radius=0.5)
    scene = scene_of(ring=torus(), ball=ball)
    of_scene = SceneEvidence(scene, SurfaceTypes.assign(scene, ["ring"]), [inputs_of(constant_light())])
    effect = self_occlusion(Evidence(of_scene, Camera.look_at((0, 0, 5), (0, 0, 0))))
    assert effect.on
    assert effect.why.endswith("reflect nothing: ball")
