"""One material under one environment, loaded, with the truth that everything in it is judged by."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import rsibr
from rsibr.bake.atomic import checksum, file_checksum, read_bytes, write_atomic
from rsibr.bake.directory import make_folder
from rsibr.geometry.frame import unit_view, view_frame
from rsibr.geometry.viewpoints import icosphere
from rsibr.scene.config import Config
from rsibr.scene.environment import Environment, load_environment
from rsibr.scene.material import Material, load_material
from rsibr.scene.views import load_viewpoints
from rsibr.study.config import StudyConfig
from rsibr.study.journal import Journal, name_of
from rsibr.study.path_tracing import PathTracer
from rsibr.validate.reference import MINIMUM_BUFFERS, Reference

Arrays = dict[str, NDArray[Any]]

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
    def tracer(self) -> PathTracer:
        """Path tracer at the judged resolution, compiled once."""
        return PathTracer(self.environment, self.material, self.resolution)

    @cached_property
    def identity(self) -> dict[str, Any]:
        """What every result in this scene depends on."""
        return {
            "environment": self.environment.digest,
            "material": self.material.digest,
            "warp": self.material.warp,
            "effects": self.config.effects.model_dump(mode="json"),
            "clamp": self.config.sampling.clamp,
            "seed": self.seed,
            "views": None if self.config.views.file is None else file_checksum(self.config.views.file),
            "resolution": self.resolution,
            "variant": mi.variant(),
            "versions": {name: version(name) for name in ("mitsuba", "drjit")} | {"rsibr": rsibr.__version__},
        }


def load_scenes(study: StudyConfig, resolution: int) -> list[Scene]:
    """Load every scene of a study, and give each a name of its own."""
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


class TruthStore:
    """References and the like on disk, rendered once.

    Parameters
    ----------
    folder : Path
        Where the arrays lie; made where missing.
    journal : Journal
        Where it is noted, with a checksum, that they are whole.
    """

    def __init__(self, folder: Path, journal: Journal) -> None:
        self._folder, self._journal = folder, journal
        make_folder(folder)

    def has(self, key: Mapping[str, Any]) -> bool:
        """Whether the arrays of `key` are there, whole."""
        note = self._journal.find(key)
        path = self._path(key)
        return note is not None and path.is_file() and file_checksum(path) == note["sha256"]

    def get(self, key: Mapping[str, Any], make: Callable[[], tuple[Arrays, dict[str, Any]]]) -> tuple[Arrays, Any]:
        """Return the arrays of `key` and what is known of them; make and keep them where they are not there, whole."""
        if not self.has(key):
            arrays, facts = make()
            data = _packed(arrays)
            write_atomic(self._path(key), data)
            self._journal.store(key, {"sha256": checksum(data), "facts": facts})
        return _unpacked(read_bytes(self._path(key))), self._journal.find(key)["facts"]

    def _path(self, key: Mapping[str, Any]) -> Path:
        return self._folder / f"{name_of(key)}.npz"


def reference_key(scene: Scene, frame: NDArray[np.float64], samples: int) -> dict[str, Any]:
    """What a reference depends on."""
    return {"kind": "reference", **scene.identity, "frame": frame.tolist(), "samples": samples}


def reference_of(scene: Scene, frame: NDArray[np.float64], samples: int, store: TruthStore) -> Reference:
    """Path-traced truth of a view, from the disk where it is there."""

    def make() -> tuple[Arrays, dict[str, Any]]:
        made = scene.tracer.render(frame, samples, seed=scene.seed, buffers=MINIMUM_BUFFERS)
        facts = {"samples": made.samples, "seconds": made.seconds, "sampler": made.sampler}
        return {"buffers": made.buffers, "coverage": made.coverage}, facts

    arrays, facts = store.get(reference_key(scene, frame, samples), make)
    return Reference(
        arrays["buffers"], arrays["coverage"], facts["samples"], facts["seconds"], sampler=facts["sampler"]
    )


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


def _packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def _unpacked(data: bytes) -> Arrays:
    with zipfile.ZipFile(io.BytesIO(data)) as names, np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return {name.removesuffix(".npy"): arrays[name.removesuffix(".npy")] for name in names.namelist()}
