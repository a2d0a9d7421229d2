"""The prepared scene: made once, and handed to everything that bakes, forecasts, probes, validates or studies."""

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
    """A config with all that follows from it; what not everyone needs is made when it is first asked for.

    Attributes
    ----------
    config : Config
        As it was asked for: what is `"auto"` in it stays so.
    parts : SceneParts
        What holds for maps of every size, shared by all scenes that `resized` returns.
    block : int or None
        Samples of a block in which the plan weighs the light's samples; None: as the config's samples are split.
    """

    config: Config
    parts: SceneParts
    block: int | None = None

    def __repr__(self) -> str:
        return f"Scene({self.material.name} under {self.environment.name})"

    @classmethod
    def prepare(cls, config: ConfigLike, overrides: Sequence[str] = ()) -> Scene:
        """Load and check what a config names.

        Parameters
        ----------
        config : Config, mapping or path
            See `rsibr.scene.config.config_of`.
        overrides : sequence of str
            `a.b=value`, laid over it.

        Raises
        ------
        InputError
            If the config, the environment or the material is wrong.
        MachineError
            If the machine has no usable backend.
        """
        settings = config_of(config, overrides)
        return cls(settings, SceneParts.of(settings))

    def resized(self, config: Config, block: int | None = None) -> Scene:
        """Return the scene of another config of the same environment and material: what both need is made once.

        Parameters
        ----------
        config : Config
            May differ in views, maps, samples, effects and budget.
        block : int, optional
            See the class.
        """
        own = self.config
        if (config.environment, config.material) != (own.environment, own.material):
            raise ValueError("the environment and the material of a scene are what they are")
        return replace(self, config=config, block=block)

    @property
    def environment(self) -> Environment:
        """The distant light."""
        return self.parts.environment

    @property
    def material(self) -> Material:
        """The coating."""
        return self.parts.material

    @property
    def digests(self) -> dict[str, str]:
        """Digest of the content of environment and material."""
        return {"environment": self.environment.digest, "material": self.material.digest}

    @cached_property
    def plan(self) -> Plan:
        """Which effects are simulated, without their costs."""
        block = self.block or block_sizes(self.config.sampling.count).size
        return make_plan(self.config, self.parts.probes, self.parts.sampling_ratio(block))

    @property
    def rendering(self) -> Rendering:
        """What is carried along a path."""
        return self.plan.rendering

    @cached_property
    def variant(self) -> str:
        """Mitsuba's name of the variant that renders the maps."""
        with backend.rendering(self.rendering) as variant:
            return variant

    @property
    def resolution(self) -> int:
        """Texels a side of the maps, as planned."""
        return self.plan.resolution

    @property
    def keeps_apart(self) -> bool:
        """Whether the lobes of the material are stored apart."""
        return self.config.effects.lobes != "off"

    @cached_property
    def lobes(self) -> Sequence[Lobe]:
        """Lobes of the material as the maps show them; none where they are not kept apart."""
        return self.parts.lobes(self.rendering) if self.keeps_apart else ()

    @cached_property
    def stored_lobes(self) -> list[Lobe]:
        """Lobes that a bake stores: those that are not left out.

        Where `effects.fresnel` is forced off each has one albedo for all angles: a reconstruction carries nothing.
        """
        kept = [lobe for lobe in self.lobes if lobe.name not in self.plan.left_out]
        if self.plan["fresnel"].forced != "off":
            return kept
        return [replace(lobe, albedo=np.broadcast_to(over_disk(lobe.albedo), lobe.albedo.shape)) for lobe in kept]

    @property
    def light(self) -> Light:
        """The light, with what the stored lobes look up in it."""
        shapes = {lobe.name: shape_of(lobe_record(lobe, self.plan)) for lobe in self.stored_lobes}
        return self.parts.light(self.rendering, any(lobe.is_mirror for lobe in self.lobes), shapes)

    @cached_property
    def all_around(self) -> Viewpoints:
        """The views that the config asks for."""
        return load_viewpoints(self.config.views)

    @cached_property
    def viewpoints(self) -> Viewpoints:
        """The views to bake; see `planned_views`."""
        return self.planned_views(self.all_around)

    def planned_views(self, viewpoints: Viewpoints) -> Viewpoints:
        """Return the views to bake of these: all of them, or one where every lobe has a closed form in the light alone.

        That one map is what the closed forms are held against; without lobes kept apart there are none.
        """
        return viewpoints if self.plan.needs_views or not self.keeps_apart else witness(viewpoints)

    @cached_property
    def frames(self) -> list[NDArray[np.float64]]:
        """Frame of each view to bake."""
        return [view_frame(view) for view in self.viewpoints.directions]

    @property
    def options(self) -> EstimateOptions:
        """What an estimate takes in."""
        return EstimateOptions(self.plan.grey, self.plan.light_samples, self.plan.left_out)

    @cached_property
    def integrator(self) -> SphereIntegrator:
        """What renders the planned maps, in the plan's variant."""
        return self.integrator_with(self.options)

    def integrator_with(
        self, options: EstimateOptions, *, keeps_apart: bool | None = None, rendering: Rendering | None = None
    ) -> SphereIntegrator:
        """Estimator of maps of the planned size that takes in something else; by default the lobes as planned."""
        return self.parts.integrator(
            self.resolution,
            rendering or self.rendering,
            keeps_apart=self.keeps_apart if keeps_apart is None else keeps_apart,
            clamp=self.config.sampling.clamp,
            options=options,
        )

    @property
    def identifying_config(self) -> dict[str, Any]:
        """What of the config fixes the bits of the maps, with what was settled on in place of what is open."""
        settings = self.config.to_dict()
        sampling = settings["sampling"]
        if self.config.sampling.decided_later:
            del sampling["samples"]
        else:
            sampling["samples"] = self.config.sampling.count
        return {"map": {"resolution": self.resolution}, "sampling": sampling, "effects": settings["effects"]}
