"""One material under one environment, loaded, and the views that it is judged at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import rsibr
from rsibr.backend import Rendering
from rsibr.geometry.frame import unit_view, view_frame
from rsibr.geometry.viewpoints import icosphere
from rsibr.planning.colour import ColourEffects
from rsibr.scene.config import Config
from rsibr.scene.environment import Environment, load_environment
from rsibr.scene.material import Material, load_material
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.views import load_viewpoints
from rsibr.store.atomic import file_checksum
from rsibr.studies.config import StudyConfig
from rsibr.studies.path_tracing import PathTracer

_VIEW_BRANCH = 0x7374_7564
"""Branch of the seed tree (the letters "stud") that the judged views are drawn from."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A material under an environment.

    Attributes
    ----------
    config : Config
        As the base config has it, with this material and environment.
    environment, material
        Loaded and checked.
    name, material_name, environment_name : str
        Unique within the study.
    resolution : int
        Texels a side of the judged pictures.
    """

    config: Config
    environment: Environment
    material: Material
    material_name: str
    environment_name: str
    resolution: int

    @property
    def name(self) -> str:
        """As a person calls it."""
        return f"{self.material_name} under {self.environment_name}"

    @property
    def seed(self) -> int:
        """Root of all randomness."""
        return self.config.sampling.seed

    @cached_property
    def rendering(self) -> Rendering:
        """What the bakes of this scene carry along a path, and its truth as well."""
        return ColourEffects.of(self.config).rendering

    @cached_property
    def tracer(self) -> PathTracer:
        """Path tracer at the judged resolution, compiled once."""
        return PathTracer(self.environment, self.material, self.resolution, self.rendering)

    @cached_property
    def content(self) -> dict[str, Any]:
        """What every bake of this scene depends on, beside its size."""
        return {
            "environment": self.environment.digest,
            "material": self.material.digest,
            "warp": self.material.warp,
            "effects": self.config.effects.model_dump(mode="json"),
            "clamp": self.config.sampling.clamp,
            "seed": self.seed,
            "views": None if self.config.views.file is None else file_checksum(self.config.views.file),
            "variant": mi.variant(),
            "versions": {name: version(name) for name in ("mitsuba", "drjit")} | {"rsibr": rsibr.__version__},
        }

    @property
    def identity(self) -> dict[str, Any]:
        """What every picture of this scene depends on."""
        return {**self.content, "resolution": self.resolution}


def load_scenes(study: StudyConfig, resolution: int) -> list[Scene]:
    """Load every scene of a study, and give each a name of its own."""
    load_plugins(name for config in study.scenes for name in config.plugin_modules)
    loaded = [(config, load_environment(config.environment), load_material(config.material)) for config in study.scenes]
    materials = _names({f"{m.digest} {m.warp}": _with_warp(m.name, c.material.warp) for c, _, m in loaded})
    environments = _names({environment.digest: environment.name for _, environment, _ in loaded})
    return [
        Scene(
            config,
            environment,
            material,
            materials[f"{material.digest} {material.warp}"],
            environments[environment.digest],
            resolution,
        )
        for config, environment, material in loaded
    ]


def judged_views(study: StudyConfig) -> list[NDArray[np.float64]]:
    """Frames of the views to judge at, the same in every scene and for every bake.

    The first half, rounded up, look along triangle centroids of the icosahedron (of the user's own views where the base
    config has them): the places farthest from every stored view. Subdividing leaves a triangle around each of them,
    with the same centroid, so that they stay the worst places at every subdivision. The others are random.
    """
    base, count = study.scenes[0], study.judge.views
    viewpoints = icosphere(0) if base.views.file is None else load_viewpoints(base.views)
    generator = np.random.default_rng(np.random.SeedSequence(base.sampling.seed, spawn_key=(_VIEW_BRANCH,)))
    worst = min((count + 1) // 2, len(viewpoints.triangles))
    chosen = viewpoints.triangles[generator.permutation(len(viewpoints.triangles))[:worst]]
    centroids = viewpoints.directions[chosen].sum(axis=1)
    views = [*centroids, *generator.normal(size=(count - worst, 3))]
    return [view_frame(unit_view(view)) for view in views]


def _with_warp(name: str, warp: str) -> str:
    """Name a material that is warped otherwise than it would be by itself."""
    return name if warp == "auto" else f"{name} ({warp} warp)"


def _names(by_digest: Mapping[str, str]) -> dict[str, str]:
    """Number names that several contents share."""
    named: dict[str, str] = {}
    for digest, name in by_digest.items():
        unique, number = name, 1
        while unique in named.values():
            number += 1
            unique = f"{name} {number}"
        named[digest] = unique
    return named
