"""What the effects of an object are decided from: the scene, its bakes, and the camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rsibr.methods.inputs import MethodInputs
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.occlusion.self_visibility import TypeVisibility, self_visibility
from rsibr.shading.pictures.picture import NormalCounts
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes


@dataclass(eq=False)
class SceneEvidence:
    """Evidence that no camera changes.

    Attributes
    ----------
    scene : ObjectScene
        Shapes.
    types : SurfaceTypes
        Type of each shape.
    inputs : sequence of MethodInputs
        Inputs of the bake of each type.
    environment_distance : float or None
        Distance [scene units] from the object to what lights it; None: infinite, as in all bakes.
    """

    scene: ObjectScene
    types: SurfaceTypes
    inputs: Sequence[MethodInputs]
    environment_distance: float | None = None

    @cached_property
    def visibility(self) -> tuple[TypeVisibility, ...]:
        """What the shapes hide from the surfaces of each type; measured at first use."""
        return self_visibility(self.scene, self.types, self.inputs)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence for one picture.

    Attributes
    ----------
    of_scene : SceneEvidence
        What no camera changes.
    camera : Camera
        Camera of the picture.
    lookup : str
        Lookup that was asked for; "auto" if the plan chooses.
    rays : int
        Rays a pixel.
    switches : mapping of str to {"auto", "on", "off"}
        What is forced, by the effect's name.
    counts : NormalCounts or None
        Normals made safe in the picture; None before it is rendered.
    silhouette_share : float or None
        Share of the covered pixels that the object covers in part; None before the picture is rendered.
    """

    of_scene: SceneEvidence
    camera: Camera
    lookup: str = "auto"
    rays: int = 16
    switches: Mapping[str, str] = field(default_factory=dict)
    counts: NormalCounts | None = None
    silhouette_share: float | None = None

    @property
    def scene(self) -> ObjectScene:
        """Shapes."""
        return self.of_scene.scene

    def switch(self, name: str) -> str:
        """What an effect is set to: "auto" unless it is forced."""
        return self.switches.get(name, "auto")

    @property
    def distance(self) -> float:
        """From the camera to the middle of the object."""
        return float(np.linalg.norm(self.camera.position - self.scene.centre))
