"""Small real bakes, made once, for tests of the methods."""

import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.baking.blocks import block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material

RESOLUTION, SAMPLES, REFERENCE_SAMPLES = 48, 256, 1024
VIEWS = ([1, 2, 3], [-0.3, 0.2, -0.9], [0.5, -1, 0.3], [0.1, 1, 0.2])
MATERIALS = ("rough-aluminium", "clearcoat-red")

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
def small_bakes(tmp_path_factory, asymmetric_environment):
    """Return a function: material → its bake under the asymmetric environment."""
    folder, made = tmp_path_factory.mktemp("bakes"), {}

    def baked(material):
        if material not in made:
            config = folder / f"{material}.toml"
            filled = {"material": material, "resolution": RESOLUTION, "samples": SAMPLES}
            config.write_text(CONFIG.format(environment=asymmetric_environment, **filled))
            made[material] = bake(config, out=folder / f"{material}.rsibr")
        return made[material]

    return baked


@pytest.fixture(scope="session")
def references(asymmetric_environment):
    """Return a function: material → for each of `VIEWS` frame, mask of the disk, radiance and its variance."""
    made = {}

    def rendered(material):
        if material not in made:
            light = load_environment(EnvironmentConfig(file=asymmetric_environment)).emitter()
            integrator = SphereIntegrator(light, load_material(MaterialConfig(preset=material)).bsdf(), RESOLUTION)
            made[material] = [truth(integrator, view_frame(view), index) for index, view in enumerate(VIEWS)]
        return made[material]

    return rendered


def truth(integrator, frame, index):
    stored = bake_view(integrator, frame, block_sizes(REFERENCE_SAMPLES), seed=99, index=index)
    covered = stored.coverage >= 0.5
    radiance, variance = stored.layers["radiance"][covered], stored.variance[covered]
    return frame, covered, radiance.astype(np.float64), variance.astype(np.float64)
