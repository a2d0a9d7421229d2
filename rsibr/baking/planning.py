"""The plan inside a bake: made before it, carried out by it, and given its costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import mitsuba as mi
import numpy as np

from rsibr import backend
from rsibr.baking.integrator import EstimateOptions, SphereIntegrator
from rsibr.baking.pilot import sampling_ratio
from rsibr.geometry.viewpoints import Viewpoints, witness
from rsibr.lobes.albedo import over_disk
from rsibr.lobes.split import Lobe, LobeSplit
from rsibr.planning.costs import Costs
from rsibr.planning.plan import Plan
from rsibr.planning.planner import make_plan, probe_scene
from rsibr.scene.config import Config, MapConfig
from rsibr.scene.environment import Environment
from rsibr.scene.material import Material
from rsibr.store.manifest import Manifest

BAKED = "measured: median seconds and bytes of the maps of this bake; `rsibr plan` measures what is absent here"


def planned_scene(settings: Config, environment: Environment, bsdf: mi.BSDF, block: int) -> tuple[Plan, LobeSplit]:
    """Probe a scene, try how to sample it where that is a question, and decide; the lobes come along.

    `block`: samples a texel in one block of the bake.
    """
    probes = probe_scene(environment, bsdf)
    ratio = sampling_ratio(environment.emitter(), bsdf, block) if probes.wants_pilot else None
    return make_plan(settings, probes, ratio), probes.split


def planned_settings(settings: Config, plan: Plan) -> Config:
    """Return the config with the resolution that the plan settled on."""
    if plan.resolution == settings.map.resolution:
        return settings
    return settings.model_copy(update={"map": MapConfig(resolution=plan.resolution)})


def planned_viewpoints(viewpoints: Viewpoints, settings: Config, plan: Plan) -> Viewpoints:
    """Return the views to bake: all of them, or one where every lobe has a closed form in the light alone.

    That one map is what the closed forms are held against; without lobes kept apart there are none.
    """
    return viewpoints if plan.needs_views or settings.effects.lobes == "off" else witness(viewpoints)


def estimate_options(plan: Plan) -> EstimateOptions:
    """What the integrator takes in."""
    return EstimateOptions(plan.grey, plan.light_samples, plan.left_out)


def planned_integrator(
    settings: Config, environment: Environment, material: Material, split: LobeSplit | None, plan: Plan, resolution: int
) -> SphereIntegrator:
    """Build what renders the planned maps, in the plan's variant; without a `split` lobes are not kept apart."""
    with backend.rendering(plan.rendering):
        return SphereIntegrator(
            environment.emitter(), material.bsdf(), resolution, split, settings.sampling.clamp, estimate_options(plan)
        )


def planned_lobes(lobes: Sequence[Lobe], plan: Plan) -> list[Lobe]:
    """Lobes that the bake stores; none where they are not kept apart.

    Where `effects.fresnel` is forced off each has one albedo for all angles: a reconstruction carries nothing.
    """
    kept = [lobe for lobe in lobes if lobe.name not in plan.left_out]
    if plan["fresnel"].forced != "off":
        return kept
    return [replace(lobe, albedo=np.broadcast_to(over_disk(lobe.albedo), lobe.albedo.shape)) for lobe in kept]


def baked_costs(manifest: Manifest, views: int) -> Costs:
    """Costs of a map, from the maps of a finished bake; `views`: how many the config asked for."""
    apart = manifest.views[: min((lobe.views or views for lobe in manifest.lobes), default=views)]
    return Costs(
        views=views,
        lobes=max(1, len(manifest.lobes)),
        seconds=median(state.seconds or 0.0 for state in manifest.views),
        bytes=round(median(state.bytes or 0 for state in apart)),
        source=BAKED,
    )
