"""Fixtures of the page's tests: a real browser, and small bakes under a sky without symmetry."""

import pytest

from rsibr.baking.baker import bake
from tests.browser import started

CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "{material}"
[map]
resolution = {resolution}
[sampling]
samples = {samples}
"""


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium, one for the session; see `tests.browser`."""
    with started() as running:
        yield running


@pytest.fixture(scope="session")
def baked(tmp_path_factory, asymmetric_environment):
    """Return a function: material, texels a side, samples → bake."""
    folder, made = tmp_path_factory.mktemp("published"), {}

    def of(material, resolution=32, samples=32):
        key = material, resolution, samples
        if key not in made:
            name = "-".join(map(str, key))
            config = folder / f"{name}.toml"
            config.write_text(
                CONFIG.format(
                    environment=asymmetric_environment, material=material, resolution=resolution, samples=samples
                )
            )
            made[key] = bake(config, out=folder / f"{name}.rsibr")
        return made[key]

    return of
