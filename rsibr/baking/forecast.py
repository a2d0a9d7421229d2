"""The plan of a config, by itself: what a bake would simulate, and what that would cost on this machine."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from rsibr import backend
from rsibr.baking.blocks import block_sizes
from rsibr.baking.calibration import calibrate
from rsibr.baking.planning import planned_integrator, planned_scene, planned_settings, planned_viewpoints
from rsibr.baking.sampling import Sampler
from rsibr.geometry.frame import view_frame
from rsibr.planning.costs import priced
from rsibr.planning.plan import Plan
from rsibr.scene.config import Config, load_config
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.views import load_viewpoints
from rsibr.store.manifest import SamplingRecord


@backend.in_session
def plan(config: Config | Path | str, *, overrides: Sequence[str] = ()) -> Plan:
    """Say which effects a scene calls for, with the evidence, the cost and what leaving each out would do.

    Parameters
    ----------
    config : Config or path
        What would be baked; a path to a TOML file, or a config already read.
    overrides : sequence of str
        `key=value` pairs that override keys of the config file.

    Returns
    -------
    Plan
        With costs calibrated on this machine. Nothing is baked and nothing is written.

    Raises
    ------
    InputError
        If the config, the environment, the material or the views are wrong.
    MachineError
        If the machine has no usable backend.
    """
    settings = config if isinstance(config, Config) else load_config(Path(config), overrides)
    return forecast(settings)[0]


def forecast(settings: Config) -> tuple[Plan, SamplingRecord | None]:
    """Plan, and the samples that a bake would take where the config leaves their count to an error or a time."""
    begun = time.perf_counter()
    load_plugins(settings.plugin_modules)
    backend.use()
    environment, material = load_environment(settings.environment), load_material(settings.material)
    viewpoints = load_viewpoints(settings.views)
    made, split = planned_scene(settings, environment, material.bsdf(), block_sizes(settings.sampling.samples).size)
    kept_apart = None if settings.effects.lobes == "off" else split
    lowered = planned_settings(settings, made)
    sampling = None
    if settings.sampling.decided_later:
        integrator = planned_integrator(settings, environment, material, kept_apart, made, made.resolution)
        with backend.rendering(made.rendering):
            baked = planned_viewpoints(viewpoints, settings, made).directions
            sampling = Sampler(integrator, [view_frame(view) for view in baked], settings.sampling).choose(begun)
        counted = settings.sampling.model_copy(update={"samples": sampling.samples})
        lowered = lowered.model_copy(update={"sampling": counted})
    costs = calibrate(lowered, environment, material, kept_apart, made, len(viewpoints))
    return priced(made, costs, settings.map.resolution), sampling
