"""The plan of a config, by itself: what a bake would simulate, and what that would cost on this machine."""

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
    """Say which effects a scene calls for, with the evidence, the cost and what leaving each out would do.

    Parameters
    ----------
    config : Config, mapping or path
        What would be baked: a config, its tables, or a path to a TOML file.
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
    with clock.counting() as begun:
        return forecast(Scene.prepare(config, overrides), begun)[0]


def forecast(scene: Scene, begun: float) -> tuple[Plan, SamplingRecord | None]:
    """Plan, and the samples that a bake would take where the config leaves their count to an error or a time.

    Parameters
    ----------
    scene : Scene
    begun : float
        When the work on it began, by `time.perf_counter`: a budget of seconds runs from there.
    """
    asked, sampling = scene.config.sampling, None
    # What a bake does before its first view and after its last
    _ = scene.plan, scene.integrator
    light_bytes = len(encode_light(scene.light))
    if asked.decided_later:
        with backend.rendering(scene.rendering):
            sampling = Sampler(scene.integrator, scene.frames, asked).choose(begun)
    overhead = time.perf_counter() - begun
    costs = calibrate(scene, sampling.samples if sampling else asked.count)
    costs = replace(costs, overhead_seconds=overhead + costs.overhead_seconds, light_bytes=light_bytes)
    return priced(scene.plan, costs, scene.config.map.side), sampling
