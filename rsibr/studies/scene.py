"""One material under one environment, and the views at which error is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr.backend import Rendering
from rsibr.baking.finished import baking_code
from rsibr.baking.loader import Loader
from rsibr.baking.scene import Scene
from rsibr.geometry.frame import view_frame
from rsibr.geometry.novel_views import novel_views
from rsibr.geometry.viewpoints import icosphere
from rsibr.planning.colour import ColourEffects
from rsibr.scene.config import Config
from rsibr.scene.environment import Environment
from rsibr.scene.material import Material
from rsibr.scene.views import load_viewpoints
from rsibr.source_code import source_digest
from rsibr.store.atomic import file_checksum
from rsibr.studies.config import StudyConfig
from rsibr.studies.path_tracing import PathTracer
from rsibr.version import __version__

_VIEW_BRANCH = 0x7374_7564
"""Branch of the seed tree (the letters "stud") that the judged views are drawn from."""

JUDGING = (
    "rsibr.validation",
    *(f"rsibr.studies.{name}" for name in ("bench", "baked", "lobes", "noise", "path_tracing", "truth", "variants")),
)
"""Modules whose code determines errors and times of pictures, beside those that bake and those of the methods."""


@dataclass(frozen=True, eq=False)
class StudyScene:
    """A material under an environment, with its names in the study.

    Attributes
    ----------
    prepared : Scene
        Of the base config, with this material and environment.
    material_name, environment_name : str
        Unique within the study.
    material_class : str
        Materials of one class are summed up together.
    resolution : int
        Texels a side of the judged pictures.
    """

    prepared: Scene
    material_name: str
    environment_name: str
    material_class: str
    resolution: int

    @property
    def config(self) -> Config:
        """The base config with this material and environment."""
        return self.prepared.config

    @property
    def environment(self) -> Environment:
        """Loaded and checked."""
        return self.prepared.environment

    @property
    def material(self) -> Material:
        """Loaded and checked."""
        return self.prepared.material

    @property
    def name(self) -> str:
        """Name to show."""
        return f"{self.material_name} under {self.environment_name}"

    @property
    def seed(self) -> int:
        """Root of the seed tree."""
        return self.config.sampling.seed

    @cached_property
    def rendering(self) -> Rendering:
        """Rendering of the bakes and references of this scene."""
        return ColourEffects.of(self.config).rendering

    @cached_property
    def lobe_names(self) -> list[str]:
        """Names of the lobes of the material; they stay known when the scene is released."""
        return list(self.prepared.parts.split.names)

    @cached_property
    def tracer(self) -> PathTracer:
        """Path tracer at the judged resolution, compiled once."""
        return PathTracer(self.environment, self.material, self.resolution, self.rendering)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Everything that a bake of this scene depends on, except its size."""
        return {
            "environment": self.environment.digest,
            "material": self.material.digest,
            "warp": self.material.warp,
            "effects": self.config.effects.model_dump(mode="json"),
            "clamp": self.config.sampling.clamp,
            "seed": self.seed,
            "views": None if self.config.views.file is None else file_checksum(self.config.views.file),
            "variant": mi.variant(),
            "versions": {name: version(name) for name in ("mitsuba", "drjit")} | {"rsibr": __version__},
            "code": baking_code(),
        }

    @property
    def identity(self) -> dict[str, Any]:
        """Everything that a picture of this scene depends on."""
        return {**self.content, "resolution": self.resolution, "judging code": source_digest(*JUDGING)}

    def release(self) -> None:
        """Release what was made of the scene for rendering; it is made again where it is needed.

        Every BSDF that lives is compiled into every kernel that traces paths, of whatever scene: Dr.Jit dispatches over
        all instances.
        """
        self.__dict__.pop("tracer", None)
        self.prepared.parts.release()


def load_scenes(study: StudyConfig, resolution: int) -> list[StudyScene]:
    """Prepare every scene of a study and give it a unique name."""
    loader = Loader()
    prepared = [(Scene.prepare(scene.config, loader=loader), scene.title) for scene in study.scenes]
    materials = _names({_of_material(scene): title.name or _with_warp(scene) for scene, title in prepared})
    environments = _names({scene.environment.digest: scene.environment.name for scene, _ in prepared})
    found = []
    for scene, title in prepared:
        name = materials[_of_material(scene)]
        sky = environments[scene.environment.digest]
        found.append(StudyScene(scene, name, sky, title.material_class or name, resolution))
    return found


def judged_views(study: StudyConfig) -> list[NDArray[np.float64]]:
    """Frames of the judged views, the same for every scene and bake.

    The first half, rounded up, look along triangle centroids of the icosahedron (of the user's own views where the base
    config has them): the places farthest from every stored view. Subdividing leaves a triangle around each of them,
    with the same centroid, so that they stay the worst places at every subdivision. The others are random.
    """
    base = study.base
    viewpoints = icosphere(0) if base.views.file is None else load_viewpoints(base.views)
    seeds = np.random.SeedSequence(base.sampling.seed, spawn_key=(_VIEW_BRANCH,))
    return [view_frame(view) for _, view in novel_views(viewpoints, study.judge.views, seeds)]


def _of_material(scene: Scene) -> str:
    return f"{scene.material.digest} {scene.material.warp}"


def _with_warp(scene: Scene) -> str:
    """Name of a material, with its warp if that is not the default."""
    name, warp = scene.material.name, scene.config.material.warp
    return name if warp == "auto" else f"{name} ({warp} warp)"


def _names(by_digest: Mapping[str, str]) -> dict[str, str]:
    """Make names unique by numbers."""
    named: dict[str, str] = {}
    for digest, name in by_digest.items():
        unique, number = name, 1
        while unique in named.values():
            number += 1
            unique = f"{name} {number}"
        named[digest] = unique
    return named
