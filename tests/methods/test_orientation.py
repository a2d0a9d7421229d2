"""Every system shows the highlight where the path tracer has it, under a sky without symmetry."""

import numpy as np
import pytest

from rsibr.baking.blocks import block_sizes
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material

AXES = ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1])
SYSTEMS = {"miller1984": 0.3, "cabral1999": 0.2, "kautz2003": 0.4, "split-sum": 0.2, "rsibr": 0.02}
"""Largest relative squared error of each system; a map that is mirrored errs by more than three times as much."""


@pytest.mark.slow
@pytest.mark.parametrize("material", ["rough-aluminium", "clearcoat-red"])
def test_highlights_lie_where_the_path_tracer_has_them(material, small_bakes, asymmetric_environment):
    """Six views, poles included."""
    methods = MethodSet(small_bakes(material))
    light = load_environment(EnvironmentConfig(file=asymmetric_environment)).emitter()
    integrator = SphereIntegrator(light, load_material(MaterialConfig(preset=material)).bsdf(), 48)
    for index, view in enumerate(AXES):
        frame = view_frame(view)
        stored = bake_view(integrator, frame, block_sizes(256), seed=7, index=index)
        truth, covered = stored.layers["radiance"].astype(np.float64), stored.coverage >= 0.5

        def off(image, truth=truth, covered=covered):
            return ((image - truth)[covered] ** 2).mean() / (truth[covered] ** 2).mean()

        for name, most in SYSTEMS.items():
            found = methods[name].map(frame, 48).numpy()[..., :3]
            assert off(found) < most, (name, view)
            assert off(found[:, ::-1]) > 3 * off(found), (name, view)
