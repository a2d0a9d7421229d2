"""Evidence of scenes without a bake."""

import numpy as np
import pytest
import trimesh

from rsibr.shading.cameras.camera import Camera
from rsibr.shading.effects.evidence import Evidence, SceneEvidence
from rsibr.shading.surface_types import SurfaceTypes
from tests.shading.occlusion.objects import constant_light, inputs_of, scene_of, torus


@pytest.fixture(scope="session")
def scene_evidence():
    """Return a function: (solid, matte, gloss) → what no camera changes."""
    made = {}

    def of(solid="torus", matte=0.5, gloss=0.05):
        if (solid, matte, gloss) not in made:
            scene = scene_of(object={"torus": torus, "ball": lambda: trimesh.creation.icosphere(3)}[solid]())
            types = SurfaceTypes.assign(scene, ["*"])
            made[solid, matte, gloss] = SceneEvidence(scene, types, [inputs_of(constant_light(), matte, gloss)])
        return made[solid, matte, gloss]

    return of


@pytest.fixture
def evidence(scene_evidence):
    """Return a function: (solid, matte, gloss, spread of the view, further fields) → evidence."""

    def of(solid="torus", matte=0.5, gloss=0.05, spread=0.3, **fields):
        of_scene = scene_evidence(solid, matte, gloss)
        distance = of_scene.scene.radius / np.sin(spread)
        camera = Camera.look_at(of_scene.scene.centre + np.array([0, 0, distance]), of_scene.scene.centre, fov_deg=90)
        return Evidence(of_scene, camera, **fields)

    return of
