"""Fixtures of the page's tests: a real browser, and small bakes under a sky without symmetry."""

import pytest

from rsibr.baking.baker import bake

SKY = 'file = "{environment}"'
PRESET = 'preset = "{material}"'

CONFIG = """
[environment]
{light}
[material]
{surface}
[views]
subdivision = {subdivision}
[map]
resolution = {resolution}
[sampling]
samples = {samples}
"""


@pytest.fixture(scope="session")
def baked(tmp_path_factory, asymmetric_environment):
    """Return a function: material, texels a side, samples, and tables of a config in their place → bake."""
    folder, made = tmp_path_factory.mktemp("published"), {}

    def of(material, resolution=32, samples=32, light=SKY, surface=PRESET, subdivision=0):
        key = material, resolution, samples, subdivision
        if key not in made:
            name = "-".join(map(str, key))
            lines = CONFIG.format(
                light=light, surface=surface, resolution=resolution, samples=samples, subdivision=subdivision
            )
            config = folder / f"{name}.toml"
            config.write_text(
                lines.replace("{environment}", str(asymmetric_environment)).replace("{material}", material)
            )
            made[key] = bake(config, out=folder / f"{name}.rsibr")
        return made[key]

    return of
