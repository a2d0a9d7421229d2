"""What a plan costs: looking at the material and the light, from nothing and with its kernels at hand."""

import pytest

from rsibr.effects.planner import probe_scene
from rsibr.resources import scenes
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material

MATERIALS = ["matte-lambert", "glossy-plastic", "rough-aluminium", "clearcoat-red", "metallic-silver"]


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
