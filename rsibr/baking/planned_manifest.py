"""Manifest of a bake before its first view: everything that determines the bits of its maps."""

from __future__ import annotations

from rsibr.baking.finished import DECISIVE, SOURCE, baking_code, package_versions
from rsibr.baking.lobe_record import lobe_record
from rsibr.baking.processor import processor
from rsibr.baking.scene import Scene
from rsibr.geometry.viewpoints import Viewpoints
from rsibr.planning.plan import Plan
from rsibr.scene.material import ANISOTROPIC, VARYING, Material
from rsibr.store.manifest import BudgetRecord, EnvironmentRecord, Manifest, MaterialRecord, SamplingRecord

NO_GLINT = "its mirror lobe shows no light without extent: their reflection is a point of no size"
"""Note on a delta lobe under a delta light."""

RETROREFLECTIVE = "retroreflective: no warp reproduces retroreflection; expect larger errors between the stored views"


def plan_manifest(
    scene: Scene, viewpoints: Viewpoints, sampling: SamplingRecord, budget: BudgetRecord | None = None
) -> Manifest:
    """Manifest of the bake before its first view: all inputs that determine the bits of its maps."""
    environment, material, plan, packages = scene.environment, scene.material, scene.plan, package_versions()
    return Manifest.planned(
        config=scene.config.to_dict() if budget is None else budget.asked,
        identity={
            "config": scene.identifying_config,
            "environment": {"name": environment.name, "content": environment.digest},
            "material": {"name": material.name, "content": material.digest},
            "packages": {name: packages[name] for name in DECISIVE},
            SOURCE: baking_code(),
            "variant": scene.variant,
            "processor": processor(scene.variant),
            "blocks": sampling.identity,
            "plan": {"grey": plan.grey, "light_samples": plan.light_samples, "left_out": list(plan.left_out)},
            "lobe_views": {lobe.name: lobe.own_views for lobe in plan.lobes if lobe.own_views is not None},
        },
        packages=packages,
        variant=scene.variant,
        environment=EnvironmentRecord(name=environment.name, clipped=environment.clipped, lowest=environment.lowest),
        material=MaterialRecord(
            name=material.name, warp=material.warp, notes=_notes(material, plan, scene.parts.probes.light.is_delta)
        ),
        lobes=tuple(lobe_record(lobe, plan) for lobe in scene.stored_lobes),
        resolution=scene.resolution,
        directions=viewpoints.directions,
        triangles=viewpoints.triangles,
        plan=plan,
        sampling=sampling,
        budget=budget,
    )


def _notes(material: Material, plan: Plan, delta_light: bool) -> tuple[str, ...]:
    """Properties of the material that no warp reproduces; shown by the bake and by every report on it."""
    found = {"retroreflection": RETROREFLECTIVE, "anisotropy": ANISOTROPIC, "spatial_variation": VARYING}
    flagged = [note for name, note in found.items() if plan[name].missed]
    if delta_light and plan["mirror"].on:
        flagged.append(NO_GLINT)
    return tuple(dict.fromkeys([*material.notes, *flagged]))  # no duplicates: Mitsuba may report anisotropy too
