"""What a plan costs, and what it saves: looking at a scene, and bakes with and without what the evidence leaves out."""

import time

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from rsibr.baking.baker import bake
from rsibr.methods.reconstruction import reconstruct
from rsibr.planning.planner import probe_scene
from rsibr.resources import configs, scenes
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from tests.statistics.agreement import agreement

MATERIALS = ["matte-lambert", "glossy-plastic", "rough-aluminium", "clearcoat-red", "metallic-silver"]

CONSTANT = "environment.emitter={type='constant', radiance=0.5}"
GRADIENT = "environment.file=gradient.exr"
MATTE = "material.bsdf={type='diffuse'}"
METAL = "material.bsdf={type='roughconductor', material='none', alpha=0.2}"
RED = "material.bsdf={type='diffuse', reflectance={type='rgb', value=[0.8, 0.2, 0.1]}}"
OPEN = "open"
"""Stands for a config that leaves the resolution at its default, 256²."""

SCENES = {
    "matte grey, constant sky": (CONSTANT, MATTE),
    "matte grey, constant sky, resolution open": (CONSTANT, MATTE, OPEN),
    "rough grey metal, constant sky": (CONSTANT, METAL),
    "matte red, gradient": (GRADIENT, RED),
    "matte red, gradient, resolution open": (GRADIENT, RED, OPEN),
    "matte, city": ("material.preset=matte-lambert",),
    "mirror, city": ("material.preset=mirror-silver",),
    "clearcoat-red, city": ("material.preset=clearcoat-red",),
}
EFFECTS = ("view_dependence", "colour", "light_sampling", "resolution")
UNGATED = tuple(f"effects.{name}=on" for name in EFFECTS)
ROUNDS = 2


@pytest.mark.benchmark(group="plan")
@pytest.mark.parametrize("name", MATERIALS)
def test_probing_a_scene(benchmark, name):
    """Below 2 s is wanted, of a map of 1024 × 512 and any material; `first` has what is compiled or read from disk."""
    environment = load_environment(EnvironmentConfig(file=scenes() / "environments" / "city.exr"))
    bsdf = load_material(MaterialConfig(preset=name)).bsdf()
    first = probe_scene(environment, bsdf).seconds
    benchmark.pedantic(lambda: probe_scene(environment, bsdf), rounds=5)
    benchmark.extra_info.update(material=name, first=first)
    print(f"\n{name}: probed in {benchmark.stats.stats.median:.2f} s, the first time in {first:.2f} s")  # noqa: T201


@pytest.mark.benchmark(group="plan")
def test_gated_against_ungated(benchmark, tmp_path, gradient_sky):
    """The whole bake, plan included, the shorter of two in turn; and whether the maps agree within their noise.

    The ratio is of processor time, which others on the machine disturb less.
    """
    table = Table(
        *(
            "scene",
            "on",
            "s gated",
            "ungated",
            "CPU s gated",
            "ungated",
            "CPU ratio",
            "MiB gated",
            "ungated",
            "agree (p)",
        )
    )

    def all_scenes():
        for name, overrides in SCENES.items():
            given = [o.replace("gradient.exr", str(gradient_sky)) for o in overrides if o != OPEN]
            table.add_row(name, *_row(tmp_path / name, given, OPEN in overrides))

    benchmark.pedantic(all_scenes, rounds=1)
    Console(width=190).print(table)


def _row(folder, overrides, resolution_open):
    folder.mkdir()
    text = (configs() / "demo.toml").read_text().replace("../scenes", str(scenes()))
    (folder / "c.toml").write_text(text.replace("resolution = 160", "" if resolution_open else "resolution = 160"))
    seconds, made = {(): [], UNGATED: []}, {}
    for run in range(1 + ROUNDS):
        for forced, taken in seconds.items():
            start = np.array([time.perf_counter(), time.process_time()])
            out = folder / f"{len(forced)}.rsibr"
            # Another seed for the ungated bake: the two share no random numbers
            seed = f"sampling.seed={1 + run + 100 * len(forced)}"
            made[forced] = bake(folder / "c.toml", out=out, overrides=[*overrides, *forced, seed], fresh=True)
            taken.append(np.array([time.perf_counter(), time.process_time()]) - start)
    gated, ungated = (np.min(values[1:], axis=0) for values in seconds.values())
    plan = made[()].manifest.plan
    on = [name for name in EFFECTS if plan[name].on]
    times = [f"{values[clock]:.2f}" for clock in (0, 1) for values in (gated, ungated)]
    cells = [", ".join(on) or "none", *times, f"{gated[1] / ungated[1]:.2f}"]
    return [*cells, *(f"{b.bytes / 2**20:.2f}" for b in made.values()), _agreement(*made.values())]


def _agreement(a, b):
    """The p-value that both have the same mean; where maps are of another size or none, what `rsibr` makes of them."""
    factor = b.resolution // a.resolution
    if factor == 1 and a.view_count == b.view_count:
        return f"{agreement(a, b):.2f}"
    views = range(0, b.view_count, 3)
    made = [reconstruct(a, b.directions[index], method="rsibr").image for index in views]
    differences = [_difference(image, b.map(index), factor) for image, index in zip(made, views, strict=True)]
    return f"relMSE {np.mean(differences):.1e}, noise and all"


def _difference(small, large, factor):
    n = len(small)
    weight = large.coverage.reshape(n, factor, n, factor)[..., None]
    mean = (large.radiance.reshape(n, factor, n, factor, 3) * weight).sum((1, 3)) / np.maximum(weight.sum((1, 3)), 1e-9)
    inside = weight.mean(axis=(1, 3))[..., 0] > 0.5
    return (((small - mean) ** 2)[inside] / (mean[inside] ** 2 + (0.1 * mean[inside].mean()) ** 2)).mean()
