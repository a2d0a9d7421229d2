"""Promises held against path-traced truth: presets × maps, an error promised to each, what was reached.

Run as a script it prints the table: `python -m tests.budget.promises [--error E] [--target E] [PRESET …]`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import rsibr
from rsibr.errors import InputError
from rsibr.geometry.frame import view_frame
from rsibr.resources import scenes
from rsibr.scene.config import Config, parse_config
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.scene.presets import PRESETS
from rsibr.store.bake import Bake
from rsibr.validation.flip import exposures_for
from rsibr.validation.metrics import compare
from rsibr.validation.reference import ReferenceRenderer

RESOLUTION = 64
MAPS = ("city", "courtyard", "studio", "sunset")
REFERENCE_SAMPLES = 1024
NOISE_SAMPLES = 1024
"""Samples of the truth of stored maps: its noise is taken out, and all texels of twelve views are compared."""


@dataclass(frozen=True)
class Promise:
    """One run: what was promised, what path-traced truth says, and the interval of that; None where refused."""

    material: str
    environment: str
    promised: float
    reached: float | None = None
    ci95: tuple[float, float] | None = None
    views: int = 0
    samples: int = 0
    seconds: float = 0.0

    @property
    def kept(self) -> bool:
        """Whether the promise was reached or beaten."""
        return self.reached is not None and self.reached <= self.promised

    def __str__(self) -> str:
        """Return the row of a table."""
        name = f"{self.material:16} {self.environment:10} {self.promised:8.2g}"
        if self.reached is None or self.ci95 is None:
            return f"{name}  refused ({self.seconds:.0f} s)"
        low, high = self.ci95
        verdict = "kept" if self.kept else "BROKEN"
        size = f"{self.views:4} views {self.samples:6} samples {self.seconds:6.1f} s"
        return f"{name}  {self.reached:9.2e} [{low:9.2e}, {high:9.2e}]  {size}  {verdict}"


def config_of(material: str, environment: str, **tables: dict[str, float]) -> Config:
    sky = {"file": str(scenes() / "environments" / f"{environment}.exr")}
    plain = {"environment": sky, "material": {"preset": material}, "map": {"resolution": RESOLUTION}}
    return parse_config({**plain, **tables}, Path())


def error_of_new_views(material: str, environment: str, error: float) -> Promise:
    """Promise the error of the whole bake, and judge eight new views as `rsibr validate` does."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        try:
            made = rsibr.bake(config_of(material, environment, budget={"error": error}), out=f"{folder}/p.rsibr")
        except InputError:
            return Promise(material, environment, error, seconds=time.perf_counter() - start)
        seconds = time.perf_counter() - start
        judged = rsibr.validate(made, methods=["rsibr"], samples=REFERENCE_SAMPLES, lobes=False)
        found = judged.summary["rsibr"].rel_mse
        size = made.view_count, made.manifest.samples
    return Promise(material, environment, error, found.value, found.ci95, *size, seconds)


def noise_of_stored_maps(material: str, environment: str, target: float) -> Promise:
    """Promise the noise of the stored maps: they are unbiased, so that it is all their error against the truth."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        config = config_of(material, environment, sampling={"target_error": target})
        made = rsibr.bake(config, out=f"{folder}/p.rsibr")
        seconds = time.perf_counter() - start
        errors = list(_against_truth(made, config))
        size = made.view_count, made.manifest.samples
    value, reach = np.mean(errors), 1.96 * np.std(errors) / np.sqrt(len(errors))
    ci95 = float(value - reach), float(value + reach)
    return Promise(material, environment, target, float(value), ci95, *size, seconds)


def _against_truth(made: Bake, config: Config) -> Iterator[float]:
    environment, material = load_environment(config.environment), load_material(config.material)
    renderer = ReferenceRenderer(environment, material, made.resolution)
    for index in range(made.view_count):
        stored = made.map(index)
        truth = renderer.render(view_frame(made.directions[index]), NOISE_SAMPLES, seed=77)
        exposures = exposures_for(float(truth.mean[truth.coverage > 0].mean()))
        yield compare(stored.radiance, truth, exposures).rel_mse.value


def main() -> int:
    """Print the table; 1 where fewer than nine of ten promises were kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--error", type=float)
    parser.add_argument("--target", type=float)
    parser.add_argument("presets", nargs="*", default=list(PRESETS))
    given = parser.parse_args()
    made = []
    for preset in given.presets:
        for environment in MAPS:
            if given.error is not None:
                made.append(error_of_new_views(preset, environment, given.error))
                print(made[-1], flush=True)  # noqa: T201
            if given.target is not None:
                made.append(noise_of_stored_maps(preset, environment, given.target))
                print(made[-1], "(stored maps)", flush=True)  # noqa: T201
    promised = [one for one in made if one.reached is not None]
    kept = sum(one.kept for one in promised)
    print(f"{kept} of {len(promised)} promises kept, {len(made) - len(promised)} refused")  # noqa: T201
    return int(kept < 0.9 * len(promised))


if __name__ == "__main__":
    sys.exit(main())
