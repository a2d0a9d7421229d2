"""Parts of a scene that do not depend on the resolution; each is made once, at its first use."""

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
from rsibr.baking.loader import Loader
from rsibr.baking.pilot import sampling_ratio
from rsibr.baking.remembered import in_this_process, small
from rsibr.light.probe import probe_light
from rsibr.light.radiance import Light, light_of
from rsibr.lobes.adaptation import adapted_lobes
from rsibr.lobes.fit import ProxyLobe
from rsibr.lobes.gaussians import LobeShape
from rsibr.lobes.proxy_ratio import proxy_ratios
from rsibr.lobes.split import Lobe, LobeSplit
from rsibr.planning.material_probe import probe_material
from rsibr.planning.planner import Probes
from rsibr.scene.config import Config
from rsibr.scene.environment import Environment
from rsibr.scene.material import Material

EVERYTHING = EstimateOptions()
"""Default options of an estimate: nothing is left out."""

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class SceneParts:
    """Environment and material, loaded and checked, with everything measured or built from them.

    Attributes
    ----------
    environment, material
        Loaded environment and material.
    """

    environment: Environment
    material: Material
    _made: dict[Any, Any] = field(default_factory=dict, repr=False)
    _seconds: list[float] = field(default_factory=list, repr=False)

    @classmethod
    @backend.in_session
    def of(cls, config: Config, loader: Loader | None = None) -> SceneParts:
        """Load the environment and the material of a config; a `loader` shares them with other scenes.

        Raises
        ------
        InputError
            If either is invalid.
        """
        environment, material, seconds = (loader or Loader()).load(config)
        parts = cls(environment, material)
        parts._seconds.append(seconds)
        return parts

    @property
    def seconds(self) -> float:
        """Time to make all parts made so far [s]."""
        return sum(self._seconds)

    @cached_property
    def bsdf(self) -> mi.BSDF:
        """BSDF of the coating, in the RGB variant."""
        with backend.rendering("rgb"):
            return self.material.bsdf()

    @property
    def split(self) -> LobeSplit:
        """Split of the material into lobes, fitted in the RGB variant."""
        return self._once("split", lambda: LobeSplit(self.bsdf, *self._fit), "rgb")

    @property
    def _fit(self) -> tuple[Sequence[ProxyLobe], list[Lobe]]:
        """Proxies and lobes of the material."""

        def fitted() -> tuple[Sequence[ProxyLobe], list[Lobe]]:
            split = LobeSplit.of(self.bsdf)
            return split.proxies, split.lobes

        return self._once("fit", fitted, "rgb", self.material.digest)

    @cached_property
    def probes(self) -> Probes:
        """Measurements that plans are based on; `Probes.seconds` includes the fit of the lobes."""
        start, environment = time.perf_counter(), self.environment
        material = self._once(
            "material probe", lambda: probe_material(self.bsdf, self.split), "rgb", self.material.digest
        )
        light = self._once(
            "light probe", lambda: probe_light(environment.emitter(), environment.image), "rgb", environment.digest,
            size=lambda probe: 2 * probe.small.nbytes,
        )  # fmt: skip
        return Probes(light, material, self.split, time.perf_counter() - start)

    def sampling_ratio(self, block: int) -> float | None:
        """See `rsibr.baking.pilot.sampling_ratio`, for blocks of `block` samples; None if the plan does not need it."""
        if not self.probes.wants_pilot:
            return None

        def measured() -> float:
            return sampling_ratio(self.environment.emitter(), self.bsdf, block)

        return self._once(("ratio", block), measured, "rgb", self.environment.digest, self.material.digest)

    def lobes(self, rendering: Rendering) -> Sequence[Lobe]:
        """Lobes adapted to maps of a rendering; see `rsibr.lobes.adaptation`."""

        def adapted() -> Sequence[Lobe]:
            return adapted_lobes(self.split, self.environment, self.material, rendering)

        return self._once(("lobes", rendering), adapted, "rgb", self.environment.digest, self.material.digest)

    def light(self, rendering: Rendering, with_image: bool, shapes: Mapping[str, LobeShape]) -> Light:
        """Environment with the tables that the lobes need; see `rsibr.light.radiance.Light`.

        An environment given as an image is RGB, for any rendering of the maps.

        Parameters
        ----------
        rendering : Rendering
            Rendering of the maps.
        with_image : bool
            Whether the environment's own image is kept; see `light_of`.
        shapes : dict of str to LobeShape
            Shape of each stored lobe, by its name.
        """
        bare = self._bare_light(rendering, with_image)
        matte = [shape.matte for shape in shapes.values() if shape.has_matte]
        glossy = any(shape.has_gaussians for shape in shapes.values())

        def with_tables() -> Light:
            light = bare.with_tables(glossy=glossy, matte=matte)
            ratios = proxy_ratios(self.split) if len(bare.delta) else {}
            return replace(light, proxy_ratios={name: ratios[name] for name in shapes if name in ratios})

        return self._once(("tables", rendering, with_image, *shapes), with_tables, "rgb")

    def shared_light(self, rendering: Rendering, with_image: bool) -> Light | None:
        """Environment with the tables of any material; None if it has lights without extent, which need the material's.

        Parameters
        ----------
        rendering, with_image
            See `light`.
        """
        bare = self._bare_light(rendering, with_image)
        if len(bare.delta):
            return None
        key = ("shared light", self._kind(rendering), with_image)
        return self._once(key, bare.for_all_materials, "rgb", self.environment.digest, size=lambda light: light.nbytes)

    def _bare_light(self, rendering: Rendering, with_image: bool) -> Light:
        kind = self._kind(rendering)

        def made() -> Light:
            return light_of(self.environment, with_image)

        return self._once(
            ("light", kind, with_image), made, kind, self.environment.digest, size=lambda light: light.nbytes
        )

    def _kind(self, rendering: Rendering) -> Rendering:
        """Rendering in which the environment is evaluated."""
        return "rgb" if self.environment.width else rendering

    def integrator(
        self,
        resolution: int,
        rendering: Rendering = "rgb",
        *,
        keeps_apart: bool = True,
        clamp: float | None = None,
        options: EstimateOptions = EVERYTHING,
    ) -> SphereIntegrator:
        """Make the estimator of maps; estimators that differ only in resolution share scene and kernels.

        Parameters
        ----------
        resolution : int
            Texels a side.
        rendering : Rendering
            Quantity carried along a path, see `rsibr.backend.Rendering`.
        keeps_apart : bool
            Whether the lobes are estimated separately.
        clamp, options
            See `SphereIntegrator`.
        """

        def built() -> SphereIntegrator:
            split = self.split if keeps_apart else None
            return SphereIntegrator(self.environment.emitter(), self.material.bsdf(), resolution, split, clamp, options)

        made = self._once(("integrator", rendering, keeps_apart, clamp, options), built, rendering)
        return made if made.coverage.shape[0] == resolution else made.at_resolution(resolution)

    def release(self) -> None:
        """Release everything made from the environment and the material; each part is made again at its next use.

        Tables that other scenes of the process have in common with this one stay; see `rsibr.baking.remembered`.
        """
        self._made.clear()
        del self._seconds[1:]  # of loading alone, whose results stay
        for name in ("bsdf", "probes"):
            self.__dict__.pop(name, None)

    def _once(
        self,
        key: Any,
        make: Callable[[], _T],
        rendering: Rendering,
        *contents: str,
        size: Callable[[_T], int] = small,
    ) -> _T:
        """Return the cached value of `key`, or make it in the variant of `rendering`.

        With `contents`, the digests of all that it depends on, it is shared with other scenes, and counts with the time
        that it took whoever made it; `size` gives its bytes.
        """
        if key not in self._made:
            before, start = self.seconds, time.perf_counter()
            with backend.rendering(rendering) as variant:
                known = in_this_process.find((variant, key, contents)) if contents else None
                self._made[key], own = known or (make(), None)
            if own is None:
                nested = self.seconds - before  # time of parts that this one needed, which is recorded already
                own = max(0.0, time.perf_counter() - start - nested)
                if contents:
                    in_this_process.keep((variant, key, contents), self._made[key], own, size(self._made[key]))
            self._seconds.append(own)
        made: _T = self._made[key]
        return made
