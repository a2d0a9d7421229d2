"""Prepared scene: made once, and passed to everything that bakes, forecasts, probes, validates or studies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.backend import Rendering
from rsibr.baking.blocks import block_sizes
from rsibr.baking.integrator import EstimateOptions, SphereIntegrator
from rsibr.baking.loader import Loader
from rsibr.baking.lobe_record import lobe_record
from rsibr.baking.parts import SceneParts
from rsibr.geometry.frame import view_frame
from rsibr.geometry.viewpoints import Viewpoints, witness
from rsibr.light.radiance import Light
from rsibr.lobes.albedo import over_disk
from rsibr.lobes.split import Lobe
from rsibr.planning.plan import Plan
from rsibr.planning.planner import make_plan
from rsibr.scene.config import Config, ConfigLike, config_of
from rsibr.scene.environment import Environment
from rsibr.scene.material import Material
from rsibr.scene.views import load_viewpoints
from rsibr.store.lobe_shape import shape_of


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """Config with environment, material, plan and integrator, each made at its first use.

    Attributes
    ----------
    config : Config
        Config as given by the user; `"auto"` values stay `"auto"`.
    parts : SceneParts
        Parts independent of the resolution, shared by all scenes that `resized` returns.
    block : int or None
        Samples a block for the plan's decision on emitter sampling; None: that of the config's samples.
    """

    config: Config
    parts: SceneParts
    block: int | None = None

    def __repr__(self) -> str:
        return f"Scene({self.material.name} under {self.environment.name})"

    @classmethod
    def prepare(cls, config: ConfigLike, overrides: Sequence[str] = (), loader: Loader | None = None) -> Scene:
        """Load and check environment and material of a config.

        Parameters
        ----------
        config : Config, mapping or path
            See `rsibr.scene.config.config_of`.
        overrides : sequence of str
            `key=value` pairs that override keys of the config.
        loader : Loader, optional
            Shares environments and materials with other scenes.

        Raises
        ------
        InputError
            If the config, the environment or the material is invalid.
        MachineError
            If the machine has no usable backend.
        """
        settings = config_of(config, overrides)
        return cls(settings, SceneParts.of(settings, loader))

    def resized(self, config: Config, block: int | None = None) -> Scene:
        """Return the scene of another config with the same environment and material; both share `parts`.

        Parameters
        ----------
        config : Config
            May differ in views, maps, samples, effects and budget.
        block : int, optional
            See the class.
        """
        own = self.config
        if (config.environment, config.material) != (own.environment, own.material):
            raise ValueError("the environment and the material must be those of the scene")
        return replace(self, config=config, block=block)

    @property
    def environment(self) -> Environment:
        """Environment."""
        return self.parts.environment

    @property
    def material(self) -> Material:
        """Material."""
        return self.parts.material

    @property
    def digests(self) -> dict[str, str]:
        """Digests of the content of environment and material."""
        return {"environment": self.environment.digest, "material": self.material.digest}

    @cached_property
    def plan(self) -> Plan:
        """Plan of the simulated effects, without costs."""
        block = self.block or block_sizes(self.config.sampling.count).size
        made = make_plan(self.config, self.parts.probes, self.parts.sampling_ratio(block))
        notes = tuple(f"{self.environment.name}: {note}" for note in self.environment.notes)
        return replace(made, environment_notes=notes)

    @property
    def rendering(self) -> Rendering:
        """Quantity carried along a path, see `rsibr.backend.Rendering`."""
        return self.plan.rendering

    @cached_property
    def variant(self) -> str:
        """Name of the Mitsuba variant that renders the maps."""
        with backend.rendering(self.rendering) as variant:
            return variant

    @property
    def resolution(self) -> int:
        """Texels a side of the maps, as planned."""
        return self.plan.resolution

    @property
    def keeps_apart(self) -> bool:
        """Whether the lobes of the material are stored separately."""
        return self.config.effects.lobes != "off"

    @cached_property
    def lobes(self) -> Sequence[Lobe]:
        """Lobes of the material in the rendering of the maps; empty if they are not stored separately."""
        return self.parts.lobes(self.rendering) if self.keeps_apart else ()

    @cached_property
    def stored_lobes(self) -> list[Lobe]:
        """Lobes that a bake stores: all but those that the plan leaves out.

        If `effects.fresnel` is forced off, each albedo is constant, so that a reconstruction ignores its variation
        with angle.
        """
        kept = [lobe for lobe in self.lobes if lobe.name not in self.plan.left_out]
        if self.plan["fresnel"].forced != "off":
            return kept
        return [replace(lobe, albedo=np.broadcast_to(over_disk(lobe.albedo), lobe.albedo.shape)) for lobe in kept]

    @property
    def light(self) -> Light:
        """Environment with the tables that the stored lobes need."""
        records = [lobe_record(lobe, self.plan) for lobe in self.stored_lobes]
        shapes = {record.name: shape_of(record) for record in records}
        return self.parts.light(self.rendering, any(lobe.is_mirror for lobe in self.lobes), shapes)

    @property
    def shared_light(self) -> Light:
        """Environment as bakes of any material under this sky share it; `light` where the material has a part in it."""
        shared = self.parts.shared_light(self.rendering, any(lobe.is_mirror for lobe in self.lobes))
        return self.light if shared is None else shared

    @cached_property
    def all_around(self) -> Viewpoints:
        """Views that the config asks for."""
        return load_viewpoints(self.config.views)

    @cached_property
    def viewpoints(self) -> Viewpoints:
        """Views to bake; see `planned_views`."""
        return self.planned_views(self.all_around)

    def planned_views(self, viewpoints: Viewpoints) -> Viewpoints:
        """Return the views to bake: all of `viewpoints`, or one if every lobe is predicted from the environment alone.

        The single map serves to check those predictions. If lobes are not stored separately, all views are needed.
        """
        return viewpoints if self.plan.needs_views or not self.keeps_apart else witness(viewpoints)

    @cached_property
    def frames(self) -> list[NDArray[np.float64]]:
        """Frame of each view to bake."""
        return [view_frame(view) for view in self.viewpoints.directions]

    @property
    def options(self) -> EstimateOptions:
        """Simplifications of the estimate, as planned."""
        return EstimateOptions(self.plan.grey, self.plan.light_samples, self.plan.left_out)

    @cached_property
    def integrator(self) -> SphereIntegrator:
        """Integrator of the planned maps, in the plan's variant."""
        return self.integrator_with(self.options)

    def integrator_with(
        self, options: EstimateOptions, *, keeps_apart: bool | None = None, rendering: Rendering | None = None
    ) -> SphereIntegrator:
        """Integrator of maps of the planned size with other options; by default with lobes and rendering as planned."""
        return self.parts.integrator(
            self.resolution,
            rendering or self.rendering,
            keeps_apart=self.keeps_apart if keeps_apart is None else keeps_apart,
            clamp=self.config.sampling.clamp,
            options=options,
        )

    @property
    def identifying_config(self) -> dict[str, Any]:
        """Part of the config that determines the bits of the maps, with `"auto"` values resolved."""
        settings = self.config.to_dict()
        sampling = settings["sampling"]
        if self.config.sampling.decided_later:
            del sampling["samples"]
        else:
            sampling["samples"] = self.config.sampling.count
        return {"map": {"resolution": self.resolution}, "sampling": sampling, "effects": settings["effects"]}
