"""Agenda of a study: its bakes, and the variants of reconstruction that are measured on each."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from rsibr.errors import InputError
from rsibr.methods.registry import registration, registrations
from rsibr.methods.warp_blend.disk_mesh import DiskMesh
from rsibr.scene.config import Config, MapConfig, SamplingConfig, ViewsConfig
from rsibr.studies.axes import PER_TEXEL
from rsibr.studies.config import StudyConfig, SweepConfig

NO_WEIGHTS = "none"
"""Weights of a method without the option `weights`."""


@dataclass(frozen=True)
class BakeSize:
    """Parameters that fix the cost of a bake.

    Attributes
    ----------
    samples, resolution : int
        Samples a texel, texels a side.
    subdivision : int or None
        Subdivision of the icosahedron; None for views from a file.
    """

    samples: int
    resolution: int
    subdivision: int | None

    def config(self, scene: Config) -> Config:
        """Config of the bake of `scene` at this size."""
        sampling = SamplingConfig.model_validate(
            {**scene.sampling.model_dump(exclude={"target_error", "time_budget_s"}), "samples": self.samples}
        )
        views = scene.views if self.subdivision is None else ViewsConfig(subdivision=self.subdivision)
        # A study measures the effect of stored views, so that all are baked even where a plan needs only one
        effects = scene.effects.model_copy(update={"view_dependence": "on"})
        resolution = MapConfig(resolution=self.resolution)
        changed = {"sampling": sampling, "map": resolution, "views": views, "effects": effects, "budget": None}
        return scene.model_copy(update=changed)


@dataclass(frozen=True)
class Variant:
    """One way to make a picture from a bake; see `SweepConfig`.

    Attributes
    ----------
    method, warp, weights, precision : str
        `weights` is `NO_WEIGHTS` where the method has no such option.
    """

    method: str
    warp: str
    weights: str
    precision: str

    @property
    def has_own_weights(self) -> bool:
        """Whether the weights are the default of the method."""
        return self.weights == own_weights(self.method)

    def __str__(self) -> str:
        """Name of the method and of every setting that is not its default."""
        parts = [self.method]
        if self.warp != PER_TEXEL:
            parts.append(self.warp)
        if not self.has_own_weights:
            parts.append(f"{self.weights} weights")
        if self.precision != "float32":
            parts.append(self.precision)
        return ", ".join(parts)


Agenda = dict[BakeSize, list[Variant]]
"""The bakes of one scene, each with its variants."""


def agenda_of(study: StudyConfig) -> Agenda:
    """Unite the sweeps of a study; every bake and every variant occurs once.

    Parameters
    ----------
    study : StudyConfig
        All its scenes have the same agenda: they differ in material and environment only.

    Raises
    ------
    InputError
        If no method can do what a sweep asks for, or the base config rules it out.
    """
    agenda: Agenda = {}
    for number, sweep in enumerate(study.sweep, 1):
        where = f"{study.name}, sweep[{number}]"
        variants = _variants(sweep, study.method)
        if not variants:
            meshed = ", ".join(name for name, one in registrations().items() if "mesh" in one.options)
            what = f"asks for no picture: only {meshed} goes through a mesh, and not every method has weights to choose"
            raise InputError(what, where=where, fix=f"take {meshed} in, or the warp texel and the weights own")
        for size in _sizes(sweep, study.base, where):
            known = agenda.setdefault(size, [])
            known += [variant for variant in variants if variant not in known]
    methods = dict.fromkeys(variant.method for variants in agenda.values() for variant in variants)
    lobed = [name for name in methods if registration(name).needs.lobes]
    if lobed and study.base.effects.lobes == "off":
        raise InputError(f'the method {lobed[0]} needs effects.lobes = "auto"', where=f"{study.name}, base")
    return agenda


def _sizes(sweep: SweepConfig, base: Config, where: str) -> list[BakeSize]:
    if base.views.file is not None:
        if sweep.subdivision is not None:
            raise InputError("subdivision: the base config has views of its own", where=where, fix="leave one out")
        subdivisions: tuple[int | None, ...] = (None,)
    else:
        subdivisions = sweep.subdivision or (base.views.level,)
    samples = sweep.samples or (base.sampling.count,)
    resolutions = sweep.resolution or (base.map.side,)
    return [BakeSize(*combination) for combination in product(samples, resolutions, subdivisions)]


def _variants(sweep: SweepConfig, methods: tuple[str, ...]) -> list[Variant]:
    """All combinations that the methods support, each once."""
    made = (
        _variant(*combination)
        for combination in product(sweep.method or methods, sweep.warp, sweep.weights, sweep.precision)
    )
    return list(dict.fromkeys(variant for variant in made if variant is not None))


def _variant(method: str, warp: str, weights: str, precision: str) -> Variant | None:
    found = registration(method)
    if "mesh" in found.fixed:  # an alias of another method with a fixed mesh
        mesh: DiskMesh = found.fixed["mesh"]
        method, warp = found.alias_of, f"mesh-{mesh.rings}x{mesh.sectors}" if warp == PER_TEXEL else warp
    if warp != PER_TEXEL and "mesh" not in registration(method).options:
        return None
    own = own_weights(method)
    if weights not in ("own", own) and own == NO_WEIGHTS:
        return None
    return Variant(method, warp, own if weights == "own" else weights, precision)


def variant_as_is(method: str) -> Variant:
    """Return the variant of a method with all settings at their defaults."""
    return Variant(method, PER_TEXEL, own_weights(method), "float32")


def own_weights(method: str) -> str:
    """Default barycentric weights of a method; `NO_WEIGHTS` where it has no such option."""
    return str(registration(method).options.get("weights", NO_WEIGHTS))
