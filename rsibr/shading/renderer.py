"""Renderer of a scene: everything that is prepared once for any number of pictures."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rsibr import backend
from rsibr.errors import InputError
from rsibr.methods.method_name import parse_name
from rsibr.methods.method_set import MethodSet
from rsibr.methods.registry import default_method
from rsibr.planning.plan import number
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.effects.evidence import Evidence, SceneEvidence
from rsibr.shading.effects.object_plan import ObjectPlan
from rsibr.shading.effects.perspective import lookup_for
from rsibr.shading.effects.registry import SWITCHES, check_switches
from rsibr.shading.film import developed
from rsibr.shading.lookups.registry import Lookup, Shade, lookup_named
from rsibr.shading.occlusion.arriving import BOUNCES
from rsibr.shading.occlusion.occlusion import Occlusion
from rsibr.shading.pictures.picture import Picture
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.store.bake import Bake, open_bake

RAYS = 16
"""Rays a pixel by default; fewer show at silhouettes."""
_MOST_RAYS = 4096


class ObjectRenderer:
    """A scene with its surface types, prepared once for any number of pictures.

    Parameters
    ----------
    scene : ObjectScene
        Shapes.
    bakes : mapping of str to Bake
        Bake of each shape, by shape id; `"*"` stands for all other shapes.
    method : str, optional
        Method of all bakes; by default that of `rsibr.reconstruct`.
    lookup : str
        How a surface takes its radiance from the method, one of `rsibr.shading.lookups.registry.lookups`, with values
        of options if any, `NAME,OPTION=VALUE`; "auto": the cheapest that the perspective allows.
    lookup_options : mapping, optional
        Options of the lookup by name, see `LookupRegistration.options`.
    occlusion : {"auto", "on", "off"}
        Whether the object hides the sky from itself: a short form of `effects["self_occlusion"]`.
    effects : mapping of str to {"auto", "on", "off"}, optional
        What is forced, by the names of `rsibr.shading.effects`.
    environment_distance : float, optional
        Distance [scene units] to what lights the object, from which the error of a light at infinity is told.

    Attributes
    ----------
    prepare_seconds : float
        Wall time of the preparation [s].
    plan : ObjectPlan
        Effects of the last picture; before the first one, those of a camera that sees the whole object.
    """

    def __init__(
        self,
        scene: ObjectScene,
        bakes: Mapping[str, Bake],
        method: str | None = None,
        lookup: str = "pixel",
        lookup_options: Mapping[str, Any] | None = None,
        *,
        occlusion: str = "auto",
        effects: Mapping[str, str] | None = None,
        environment_distance: float | None = None,
    ) -> None:
        start = time.perf_counter()
        self.lookup, named = parse_name(lookup, "lookup")
        self.scene, self.bakes = scene, dict(bakes)
        self.switches = _switches(occlusion, effects or {})
        self._options = _checked(self.lookup, {**named, **(lookup_options or {})})
        self.types = SurfaceTypes.assign(scene, list(bakes))
        sets = {path: MethodSet(bake) for path, bake in {bake.path: bake for bake in bakes.values()}.items()}
        self.methods = [sets[bake.path][method or default_method(bake)] for bake in bakes.values()]
        self.inputs = [sets[bake.path].inputs for bake in bakes.values()]
        self._lookups: dict[str, list[Lookup]] = {}
        self._occlusions: dict[int, Occlusion] = {}
        self._evidence = SceneEvidence(scene, self.types, self.inputs, environment_distance)
        self._plan: ObjectPlan | None = None
        self.prepare_seconds = time.perf_counter() - start

    def with_occlusion(self, occlusion: str) -> ObjectRenderer:
        """Return a renderer that differs in `occlusion` alone; both share what they prepare."""
        other = copy(self)
        other.switches = self.switches | _switches(occlusion, {})
        other._plan = None
        return other

    @property
    def lookups(self) -> list[Lookup]:
        """Lookup of each surface type: the one that was asked for, a pixel's own view if none was."""
        return self.lookups_named("pixel" if self.lookup == "auto" else self.lookup)

    @property
    def plan(self) -> ObjectPlan:
        """See the attributes."""
        if self._plan is None:
            away = self.scene.centre + np.array([0.0, 0.0, 4.0]) * self.scene.radius
            self._plan = self.plan_of(self.scene.camera or Camera.look_at(away, self.scene.centre))
        return self._plan

    @backend.in_session
    def plan_of(self, camera: Camera, rays: int = RAYS) -> ObjectPlan:
        """Effects that a picture of a camera would simulate."""
        return ObjectPlan.of(self._evidence_of(camera, rays))

    @backend.in_session
    def picture(self, camera: Camera, rays: int = RAYS) -> Picture:
        """Render a picture.

        Parameters
        ----------
        camera : Camera
            Camera.
        rays : int
            Rays spread over the square of each pixel, 1 to 4096.
        """
        if not 1 <= rays <= _MOST_RAYS:
            raise InputError(f"{rays} rays a pixel", where="rays", fix=f"give 1 to {_MOST_RAYS}")
        rays = 1 if self.switches.get("silhouettes") == "off" else rays
        start = time.perf_counter()
        evidence = self._evidence_of(camera, rays)
        plan = ObjectPlan.of(evidence)
        shades = self.shades(camera, plan)
        has_footprints = self.needs_footprints(plan)
        backend.synchronize()
        prepared = time.perf_counter() - start
        made = developed(self.scene, camera, self.types, shades, rays, has_footprints=has_footprints)
        backend.synchronize()
        seconds = time.perf_counter() - start - prepared
        self._plan = ObjectPlan.of(replace(evidence, counts=made.counts, silhouette_share=_partly_covered(made)))
        notes = (*self.scene.notes, *self._choice(plan), *self._plan.notes())
        return replace(made, seconds=seconds, prepare_seconds=self.prepare_seconds + prepared, notes=notes)

    def shades(self, camera: Camera, plan: ObjectPlan) -> list[Shade]:
        """Shading of each surface type as a plan says, prepared for a camera."""
        shades = [lookup.toward(camera) for lookup in self._lookups_of(plan)]
        if not plan["self_occlusion"].on:
            return shades
        bounces = BOUNCES if plan["interreflection"].on else 0
        if bounces not in self._occlusions:
            self._occlusions[bounces] = Occlusion.of(self.scene, self.types, self.inputs, bounces=bounces)
        return [self._occlusions[bounces].shading(shade, index) for index, shade in enumerate(shades)]

    def needs_footprints(self, plan: ObjectPlan) -> bool:
        """Whether the lookups of a plan read `Surfaces.footprint`."""
        return any(lookup.needs_footprint for lookup in self._lookups_of(plan))

    def lookups_named(self, name: str) -> list[Lookup]:
        """Lookup of each surface type, made at first use."""
        if name not in self._lookups:
            options = self._options if name == self.lookup else {}
            self._lookups[name] = [lookup_named(name).make(one, self.scene, **options) for one in self.methods]
        return self._lookups[name]

    def _choice(self, plan: ObjectPlan) -> Iterator[str]:
        """Yield the lookup that "auto" stands for, with its reason."""
        if self.lookup == "auto":
            effect = plan["perspective"]
            yield f"the lookup auto is {lookup_for(effect)} ({number(effect.evidence)} {effect.unit})"

    def _lookups_of(self, plan: ObjectPlan) -> list[Lookup]:
        return self.lookups_named(lookup_for(plan["perspective"], self.lookup))

    def _evidence_of(self, camera: Camera, rays: int) -> Evidence:
        return Evidence(self._evidence, camera, self.lookup, rays, self.switches)


def _checked(lookup: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a lookup; "auto" has none."""
    if lookup != "auto":
        return lookup_named(lookup).checked(options)
    if options:
        fix = "name the lookup that it is meant for"
        raise InputError(f"no option '{min(options)}'", where="lookup 'auto'", fix=fix)
    return {}


def opened(bake: Bake | Path | str) -> Bake:
    """Open a bake, unless it is open."""
    return bake if isinstance(bake, Bake) else open_bake(Path(bake))


def _switches(occlusion: str, effects: Mapping[str, str]) -> dict[str, str]:
    """Switches of all effects that were named; InputError for what there is not."""
    if occlusion not in SWITCHES:
        raise InputError(f"'{occlusion}'", where="occlusion", fix=f"give one of: {', '.join(SWITCHES)}")
    switches = {"self_occlusion": occlusion, **effects}
    check_switches(switches)
    return switches


def _partly_covered(picture: Picture) -> float:
    covered = int((picture.alpha > 0).sum())
    return float(((picture.alpha > 0) & (picture.alpha < 1)).sum()) / max(covered, 1)
