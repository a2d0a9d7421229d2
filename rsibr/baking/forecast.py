"""Plan of a config without a bake: effects to simulate, and their cost on this machine."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from rsibr import backend, clock
from rsibr.baking.calibration import calibrate
from rsibr.baking.sampling import Sampler
from rsibr.baking.scene import Scene
from rsibr.planning.costs import priced
from rsibr.planning.plan import Plan
from rsibr.scene.config import ConfigLike
from rsibr.store.light_file import encode_light
from rsibr.store.manifest import SamplingRecord


@backend.in_session
def plan(config: ConfigLike, *, overrides: Sequence[str] = ()) -> Plan:
    """Determine which effects a scene needs, with evidence, cost, and the error of leaving each out.

    Parameters
    ----------
    config : Config, mapping or path
        A config, its tables as a mapping, or a path to a TOML file.
    overrides : sequence of str
        `key=value` pairs that override keys of the config file.

    Returns
    -------
    Plan
        Plan with costs calibrated on this machine. Nothing is baked and nothing is written.

    Raises
    ------
    InputError
        If the config, the environment, the material or the views are invalid.
    MachineError
        If the machine has no usable backend.
    """
    with clock.counting() as begun:
        return forecast(Scene.prepare(config, overrides), begun)[0]


def forecast(scene: Scene, begun: float) -> tuple[Plan, SamplingRecord | None]:
    """Plan with costs, and the sampling of a bake if the config gives a target error or a time budget.

    Parameters
    ----------
    scene : Scene
        Scene to bake.
    begun : float
        Start of the work, by `time.perf_counter`; a budget of seconds counts from it.

    Returns
    -------
    Plan
        Plan with costs.
    SamplingRecord or None
        Chosen sampling; None if the config sets the number of samples.
    """
    asked, sampling = scene.config.sampling, None
    # Work of a bake before its first view
    _ = scene.plan, scene.integrator
    light_bytes = len(encode_light(scene.light))
    if asked.decided_later:
        with backend.rendering(scene.rendering):
            sampling = Sampler(scene.integrator, scene.frames, asked).choose(begun)
    overhead = time.perf_counter() - begun
    costs = calibrate(scene, sampling.samples if sampling else asked.count)
    costs = replace(costs, overhead_seconds=overhead + costs.overhead_seconds, light_bytes=light_bytes)
    return priced(scene.plan, costs, scene.config.map.side), sampling
