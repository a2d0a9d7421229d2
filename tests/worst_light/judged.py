"""Bakes of the scenes, their path-traced truth, and the error of a method in each zone of the disk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rsibr
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import run
from rsibr.scene.config import Config, parse_config
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.store.noise import COVERED
from rsibr.validation.estimate import Estimate, jackknife
from rsibr.validation.flip import exposures_for
from rsibr.validation.metrics import ZONES, compare
from rsibr.validation.reference import Reference, ReferenceRenderer
from tests.arrays import disk_grid
from tests.scene.maps import write_exr
from tests.worst_light.scenes import MATERIALS, SCENES, Array, Lamp

METHODS = ("cabral1999", "rsibr", "rsibr-fine")
RESOLUTION, SAMPLES, TRUTH_SAMPLES = 48, 128, 512

DARK = 0.25
"""Share of the true radiance below which a texel counts as a hole."""


@dataclass(frozen=True)
class ByZone:
    """Errors of a method at one view.

    Attributes
    ----------
    rel_mse, energy : dict of str to Estimate
        Debiased relMSE, and reconstructed over true energy, of each of `ZONES`.
    brightest : float
        Brightest channel of the map over that of the truth.
    holes : float
        Share of the texels whose radiance is less than `DARK` of the true one.
    """

    rel_mse: dict[str, Estimate]
    energy: dict[str, Estimate]
    brightest: float
    holes: float


def by_zone(image: NDArray[np.float32], truth: Reference, name: str) -> ByZone:
    """Judge a map; raises `CheckFailed` where it is not finite."""
    judged = truth.coverage >= COVERED
    exposures = exposures_for(float(truth.mean[judged].mean()))
    return ByZone(
        compare(image, truth, exposures, name).rel_mse_zones,
        {zone: energy_ratio(image, truth, judged & inside(zone, len(image))) for zone in ZONES},
        float(image[judged].max() / truth.mean[judged].max()),
        float((image.mean(axis=-1) < DARK * truth.mean.mean(axis=-1))[judged].mean()),
    )


def inside(zone: str, resolution: int) -> NDArray[np.bool_]:
    """Texels whose centre lies in a zone."""
    radius, (low, high) = np.hypot(*disk_grid(resolution)), ZONES[zone]
    return np.asarray((radius >= low) & (radius < high))


def energy_ratio(image: NDArray[np.float32], truth: Reference, texels: NDArray[np.bool_]) -> Estimate:
    """Reconstructed over true energy of some texels, all channels together, with the noise of the truth."""
    weights = truth.coverage[texels].astype(np.float64)
    ours = float((weights @ image[texels].astype(np.float64)).sum())
    theirs = (truth.buffers[:, texels].astype(np.float64).sum(axis=-1) @ weights).astype(np.float64)
    left_out = (theirs.sum() - theirs) / (len(theirs) - 1)
    return jackknife(ours / theirs.mean(), ours / left_out)


def root_mean_square(image: NDArray[np.float32], truth: Reference) -> float:
    """Root mean square over texels and channels of a map or a difference of maps."""
    return float(np.sqrt((image[truth.coverage >= COVERED].astype(np.float64) ** 2).mean()))


def true_change(a: Reference, b: Reference) -> float:
    """Root mean square of the difference between two truths, their noise taken out."""
    judged = np.minimum(a.coverage, b.coverage) >= COVERED
    squared = (a.mean.astype(np.float64) - b.mean) ** 2 - a.variance_of_mean - b.variance_of_mean
    return float(np.sqrt(max(squared[judged].mean(), 0.0)))


@dataclass(eq=False)
class Lit:
    """A material under a lamp: bake, methods and truth, each made at first use.

    Attributes
    ----------
    lamp : Lamp
    bsdf : dict
        Mitsuba BSDF as plain data.
    folder : Path
        An empty folder for the files.
    resolution, samples, truth_samples : int
        Texels a side; samples a texel of the stored maps and of the truth.
    """

    lamp: Lamp
    bsdf: dict[str, object]
    folder: Path
    resolution: int = RESOLUTION
    samples: int = SAMPLES
    truth_samples: int = TRUTH_SAMPLES

    def __post_init__(self) -> None:
        self._truths = dict[bytes, Reference]()

    @cached_property
    def config(self) -> Config:
        """Config of the bake."""
        self.folder.mkdir(parents=True, exist_ok=True)
        sky = write_exr(self.folder / "sky.exr", self.lamp.image())
        tables = {"environment": {"file": str(sky)}, "material": {"bsdf": self.bsdf}}
        sizes = {"map": {"resolution": self.resolution}, "sampling": {"samples": self.samples}}
        return parse_config({**tables, **sizes}, Path())

    @cached_property
    def methods(self) -> MethodSet:
        """Methods over twelve stored maps."""
        return MethodSet(rsibr.bake(self.config, out=self.folder / "bake.rsibr"))

    @cached_property
    def renderer(self) -> ReferenceRenderer:
        """Path tracer of the same sphere."""
        environment, material = load_environment(self.config.environment), load_material(self.config.material)
        return ReferenceRenderer(environment, material, self.resolution)

    def map(self, method: str, view: Array) -> NDArray[np.float32]:
        """Reconstructed map, shape (N, N, 3)."""
        return run(self.methods[method], view_frame(view), self.resolution).image

    def truth(self, view: Array) -> Reference:
        """Path-traced map of the view."""
        if view.tobytes() not in self._truths:
            self._truths[view.tobytes()] = self.renderer.render(view_frame(view), self.truth_samples, seed=7)
        return self._truths[view.tobytes()]

    def errors(self, method: str, view: Array) -> ByZone:
        """Errors of a method at a view."""
        return by_zone(self.map(method, view), self.truth(view), method)


class Room:
    """Every material under every lamp; scenes with the same lamp share bakes.

    Parameters
    ----------
    folder : Path
        For the files.
    **sizes
        `resolution`, `samples` and `truth_samples` of `Lit`.
    """

    def __init__(self, folder: Path, **sizes: int) -> None:
        self._make = partial(Lit, **sizes)
        self._folder = folder
        self._made = dict[tuple[Lamp, str], Lit]()

    def lit(self, scene: str, material: str) -> Lit:
        """A material under the lamp of a scene."""
        lamp = SCENES[scene].lamp
        if (lamp, material) not in self._made:
            folder = self._folder / str(len(self._made))
            self._made[lamp, material] = self._make(lamp, MATERIALS[material], folder)
        return self._made[lamp, material]


def cases() -> Iterator[tuple[str, str, str]]:
    """Scene, name of the view, and material, in the order of the table."""
    for name, scene in SCENES.items():
        for view in scene.views:
            for material in MATERIALS:
                yield name, view, material
