"""What of a scene holds for maps of every size: each part is made when it is first asked for, and once."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import mitsuba as mi

from rsibr import backend
from rsibr.backend import Rendering
from rsibr.baking.integrator import EstimateOptions, SphereIntegrator
from rsibr.baking.pilot import sampling_ratio
from rsibr.light.radiance import Light, light_of
from rsibr.lobes.adaptation import adapted_lobes
from rsibr.lobes.gaussians import LobeShape
from rsibr.lobes.split import Lobe, LobeSplit
from rsibr.planning.planner import Probes, probe_scene
from rsibr.scene.config import Config
from rsibr.scene.environment import Environment, load_environment
from rsibr.scene.material import Material, load_material
from rsibr.scene.python_plugins import load_plugins

EVERYTHING = EstimateOptions()
"""What an estimate takes in by default."""

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class SceneParts:
    """A material under an environment, loaded and checked; what is measured of them and built from them.

    Attributes
    ----------
    environment, material
        The scene.
    """

    environment: Environment
    material: Material
    _made: dict[Any, Any] = field(default_factory=dict, repr=False)
    _seconds: list[float] = field(default_factory=list, repr=False)

    @classmethod
    @backend.in_session
    def of(cls, config: Config) -> SceneParts:
        """Load the environment and the material of a config.

        Raises
        ------
        InputError
            If either is wrong.
        """
        start = time.perf_counter()
        load_plugins(config.plugin_modules)
        parts = cls(load_environment(config.environment), load_material(config.material))
        parts._seconds.append(time.perf_counter() - start)
        return parts

    @property
    def seconds(self) -> float:
        """Time that all parts made so far took [s]."""
        return sum(self._seconds)

    @cached_property
    def bsdf(self) -> mi.BSDF:
        """The coating, in RGB rendering."""
        with backend.rendering("rgb"):
            return self.material.bsdf()

    @property
    def split(self) -> LobeSplit:
        """The lobes of the material, fitted in RGB rendering."""
        return self._once("split", lambda: LobeSplit.of(self.bsdf), "rgb")

    @cached_property
    def probes(self) -> Probes:
        """What plans go by; `Probes.seconds` counts the fit of the lobes too."""
        start = time.perf_counter()
        found = self._once("probes", lambda: probe_scene(self.environment, self.bsdf, self.split), "rgb")
        return replace(found, seconds=time.perf_counter() - start)

    def sampling_ratio(self, block: int) -> float | None:
        """What the light's samples are worth in blocks of so many samples; None where that is no question."""
        if not self.probes.wants_pilot:
            return None
        return self._once(("ratio", block), lambda: sampling_ratio(self.environment.emitter(), self.bsdf, block), "rgb")

    def lobes(self, rendering: Rendering) -> Sequence[Lobe]:
        """Lobes as maps show them that are rendered so; see `rsibr.lobes.adaptation`."""

        def adapted() -> Sequence[Lobe]:
            return adapted_lobes(self.split, self.environment, self.material, rendering)

        return self._once(("lobes", rendering), adapted, "rgb")

    def light(self, rendering: Rendering, with_image: bool, shapes: Mapping[str, LobeShape]) -> Light:
        """The light with what lobes look up in it; see `rsibr.light.radiance.Light`.

        An image is RGB from the start, whatever the maps are rendered in.

        Parameters
        ----------
        rendering : Rendering
            Of the maps.
        with_image : bool
            Whether the environment's own image is kept; see `light_of`.
        shapes : dict of str to LobeShape
            Shape of each stored lobe, by its name.
        """
        kind: Rendering = "rgb" if self.environment.width else rendering
        bare = self._once(("light", kind, with_image), lambda: light_of(self.environment, with_image), kind)
        matte = [shape.matte for shape in shapes.values() if shape.is_matte]
        glossy = any(not shape.is_matte and not shape.is_mirror for shape in shapes.values())
        key = ("tables", kind, rendering, with_image, *shapes)
        return self._once(key, lambda: bare.with_tables(glossy=glossy, matte=matte), "rgb")

    def integrator(
        self,
        resolution: int,
        rendering: Rendering = "rgb",
        *,
        keeps_apart: bool = True,
        clamp: float | None = None,
        options: EstimateOptions = EVERYTHING,
    ) -> SphereIntegrator:
        """Estimator of maps of any size; one that differs only in the size shares scene and kernels.

        Parameters
        ----------
        resolution : int
            Texels a side.
        rendering : Rendering
            What is carried along a path.
        keeps_apart : bool
            Whether the lobes are estimated apart.
        clamp, options
            See `SphereIntegrator`.
        """

        def built() -> SphereIntegrator:
            split = self.split if keeps_apart else None
            return SphereIntegrator(self.environment.emitter(), self.material.bsdf(), resolution, split, clamp, options)

        made = self._once(("integrator", rendering, keeps_apart, clamp, options), built, rendering)
        return made if made.coverage.shape[0] == resolution else made.at_resolution(resolution)

    def _once(self, key: Any, make: Callable[[], _T], rendering: Rendering) -> _T:
        """Return what is known under `key`, or make it in the variant of `rendering`."""
        if key not in self._made:
            before, start = self.seconds, time.perf_counter()
            with backend.rendering(rendering):
                self._made[key] = make()
            nested = self.seconds - before  # parts that this one asked for
            self._seconds.append(max(0.0, time.perf_counter() - start - nested))
        made: _T = self._made[key]
        return made
