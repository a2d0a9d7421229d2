"""Mitsuba integrator `rsibr`: shapes with a bake are shaded from it, everything else by a nested integrator.

    rsibr.register_plugins()
    scene = mi.load_dict({"type": "scene", "integrator": {"type": "rsibr", "bake_body": "out/paint.rsibr"}, …})
    picture = mi.render(scene)

Only what the camera sees directly is shaded from a bake. In mirrors, through glass and in the light that a shape throws
on others, the nested integrator sees the scene's own BSDFs and emitters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi

from rsibr import backend
from rsibr.backend import Rendering
from rsibr.errors import InputError
from rsibr.methods.method_name import parse_name
from rsibr.methods.method_set import require_served
from rsibr.methods.registry import default_method, registration
from rsibr.scene import blend
from rsibr.scene.paint import car_paint
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.corner_rays import corners_of_differentials, footprint
from rsibr.shading.effects.registry import check_switches
from rsibr.shading.lookups.registry import Shade, lookup_named
from rsibr.shading.renderer import ObjectRenderer
from rsibr.shading.rgb_spectrum import RgbSpectrum
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.scenes.shapes_digest import shapes_digest
from rsibr.shading.surface_types import UNBAKED
from rsibr.shading.surfaces import Surfaces, first_hits, surfaces_at
from rsibr.store.bake import Bake, open_bake

PLUGIN = "rsibr"
"""Name of the integrator."""

_WHERE = f"integrator '{PLUGIN}'"
_PREFIX = "bake_"
_RENDERINGS: dict[str, Rendering] = {name: name for name in ("rgb", "spectral", "spectral_polarized")}
_PIXEL = "pixel"
_ANYWHERE = Camera.look_at((0, 0, 1), (0, 0, 0))


@dataclass(eq=False)
class Prepared:
    """What is made once for a scene.

    Attributes
    ----------
    shapes : tuple of int
        Addresses of the scene's shapes, which the renderer keeps alive.
    geometry : str
        Digest of what the shapes looked like.
    renderer : ObjectRenderer
        Methods, lookups and surface types.
    spectrum : RgbSpectrum or None
        Spectra of colours; None in RGB.
    has_unbaked : bool
        Whether there are shapes without a bake.
    """

    shapes: tuple[int, ...]
    geometry: str
    renderer: ObjectRenderer
    spectrum: RgbSpectrum | None
    has_unbaked: bool


@dataclass(frozen=True, eq=False)
class Shades:
    """Shading of each surface type, and whether it reads `Surfaces.footprint`."""

    by_type: list[Shade]
    has_footprints: bool


class BakedRadiance:
    """Integrator that takes the radiance of primary hits from bakes.

    `register` derives a class of the current variant.

    Parameters of the plugin
    ------------------------
    bake_<shape id> : string
        Bake of a shape: a directory that `rsibr bake` made, relative to the scene's file or to the working directory.
    bake : string
        Bake of all other shapes that are no emitters.
    method : string
        Method of all bakes; by default that of `rsibr.reconstruct`.
    lookup : string
        How a pixel takes its radiance from the method, see `rsibr.shading.lookups.registry`, with values of options if
        any, `NAME,OPTION=VALUE`; by default `pixel`. Filters of maps take a pixel's footprint from Mitsuba's ray
        differentials.
    occlusion : string
        Whether shapes hide the environment from each other: `auto` (default), `on`, `off`.
    hide_emitters : boolean
        Passed on to the default nested integrator.
    (nested) : integrator
        For everything else; by default `path`.

    Notes
    -----
    Radiance from bakes has no derivatives; it is not attenuated by media; a shape's `opacity` is ignored. Instances of
    shape groups have no bake, and hide no light from shapes with one.
    """

    hide_emitters: bool  # of Mitsuba's base class
    skip_area_emitters: Callable[..., Any]

    def __init__(self, props: mi.Properties) -> None:
        mi.SamplingIntegrator.__init__(self, props)
        self._rendering = _rendering(mi.variant())
        self._nested = _nested(props, hides=self.hide_emitters)
        self._is_default = not props.objects()
        self._method: str | None = props.get("method", None)
        self._lookup: str = props.get("lookup", _PIXEL)
        name, options = parse_name(self._lookup, "lookup")
        if name != "auto":
            lookup_named(name).checked(options)
        self._occlusion: str = props.get("occlusion", "auto")
        check_switches({"self_occlusion": self._occlusion})
        self._bakes = {name: _opened(path, self._method) for name, path in _named_bakes(props).items()}
        self._prepared: Prepared | None = None
        self._shades: Shades | None = None

    def render(
        self,
        scene: mi.Scene,
        sensor: mi.Sensor | int = 0,
        seed: int = 0,
        spp: int = 0,
        develop: bool = True,
        evaluate: bool = True,
    ) -> mi.TensorXf:
        """Render while no session of another thread runs; see Mitsuba's `Integrator.render`."""
        seen_by = scene.sensors()[sensor] if isinstance(sensor, int) else sensor
        base = mi.SamplingIntegrator
        with backend.rendering(self._rendering):
            if self._shades is not None:  # Mitsuba's base class calls this method once more
                return base.render(self, scene, seen_by, seed, spp, develop, evaluate)
            self._shades = self._shades_toward(scene, seen_by)
            try:
                return base.render(self, scene, seen_by, seed, spp, develop, evaluate)
            finally:
                self._shades = None

    def sample(
        self,
        scene: mi.Scene,
        sampler: mi.Sampler,
        ray: mi.RayDifferential3f,
        medium: Any = None,
        active: mi.Bool = True,
    ) -> tuple[mi.Spectrum, mi.Bool, list[mi.Float]]:
        """Radiance along rays; see Mitsuba's `SamplingIntegrator.sample`."""
        prepared = self._made(scene)
        shades = self._shades if self._shades is not None else self._shades_toward(scene, None)
        types = prepared.renderer.types
        if shades.has_footprints:
            _require_differentials(ray)

        def shaded(found: mi.PreliminaryIntersection3f, ray: mi.RayDifferential3f) -> tuple[mi.Color3f, mi.UInt32]:
            surfaces = surfaces_at(found, ray)
            if shades.has_footprints:
                surfaces.footprint = footprint(scene, corners_of_differentials(ray), surfaces)
            kind = types.of(surfaces)
            return _shaded(surfaces, kind, shades.by_type), kind

        with dr.suspend_grad():
            found = self._first_hits(scene, ray, mi.Bool(active))
            radiance, kind = dr.if_stmt((found, ray), found.is_valid(), shaded, _nothing, label="hit")
        has_bake = kind != UNBAKED
        if prepared.has_unbaked or not self._is_default:
            rest, valid, _ = self._nested.sample(scene, sampler, ray, medium, active & ~has_bake)
        else:
            rest, valid = self._background(scene, ray, active & ~has_bake)
        baked = self._as_spectrum(prepared, radiance, ray)
        return dr.select(has_bake, baked, rest), valid | has_bake, []

    def aov_names(self) -> list[str]:
        """None: to have further layers, nest this integrator in `aov`."""
        return []

    def traverse(self, callback: mi.TraversalCallback) -> None:
        """Expose the nested integrator to Mitsuba."""
        callback.put("nested", self._nested, mi.ParamFlags.Differentiable)

    def to_string(self) -> str:
        """Bakes by shape, method, and the nested integrator."""
        bakes = ", ".join(f"{name} = {bake.path}" for name, bake in self._bakes.items())
        return f"{PLUGIN}[{bakes}, method = {self._method or 'default'}, nested = {self._nested}]"

    def _first_hits(self, scene: mi.Scene, ray: mi.RayDifferential3f, active: mi.Bool) -> mi.PreliminaryIntersection3f:
        """First surfaces, seen through emitters if they are hidden, as Mitsuba's own integrators do."""
        return (
            self.skip_area_emitters(scene, ray, True, active)
            if self._nested.hide_emitters
            else first_hits(scene, ray, active)
        )

    def _background(self, scene: mi.Scene, ray: mi.Ray3f, active: mi.Bool) -> tuple[mi.Spectrum, mi.Bool]:
        """What the default nested integrator returns for rays that meet nothing, in a fraction of its time."""
        light = scene.environment()
        if light is None or self._nested.hide_emitters:
            return mi.Spectrum(0), mi.Bool(False)

        def seen(ray: mi.Ray3f) -> mi.Spectrum:
            beyond = dr.zeros(mi.SurfaceInteraction3f, dr.width(ray))
            beyond.wi, beyond.time, beyond.wavelengths = -ray.d, ray.time, ray.wavelengths
            return light.eval(beyond)

        return dr.if_stmt((mi.Ray3f(ray),), active, seen, lambda _: mi.Spectrum(0), label="background"), active

    def _as_spectrum(self, prepared: Prepared, radiance: mi.Color3f, ray: mi.Ray3f) -> mi.Spectrum:
        if prepared.spectrum is None:
            return radiance
        spectrum = prepared.spectrum.at(radiance, ray.wavelengths)
        return mi.mueller.depolarizer(spectrum) if self._rendering == "spectral_polarized" else spectrum

    def _shades_toward(self, scene: mi.Scene, sensor: mi.Sensor | None) -> Shades:
        renderer = self._made(scene).renderer
        if self._lookup == _PIXEL:  # the same for every camera
            return Shades(renderer.shades(_ANYWHERE, renderer.plan), has_footprints=False)
        if sensor is None:
            fix = f"make it the scene's integrator itself, or use lookup = '{_PIXEL}'"
            raise InputError(f"lookup '{self._lookup}' needs to know the sensor", where=_WHERE, fix=fix)
        camera = Camera.of_sensor(sensor)
        plan = renderer.plan_of(camera)
        return Shades(renderer.shades(camera, plan), has_footprints=renderer.needs_footprints(plan))

    def _made(self, scene: mi.Scene) -> Prepared:
        """What the scene needs, made anew if it is another one than before, or its shapes were edited in place."""
        shapes = scene.shapes()
        addresses = tuple(shape.ptr for shape in shapes)
        known = self._prepared
        if known is not None and known.shapes == addresses and self._shades is not None:
            return known  # in a picture, whose first call compared the geometry
        geometry = shapes_digest(shapes)
        if known is None or known.shapes != addresses or known.geometry != geometry:
            with backend.rendering(self._rendering):
                objects = ObjectScene("the scene", _by_id(shapes, self._bakes))
                renderer = ObjectRenderer(objects, self._bakes, self._method, self._lookup, occlusion=self._occlusion)
                spectrum = None if self._rendering == "rgb" else RgbSpectrum()
            has_unbaked = len(renderer.types.of_shape) < len(shapes)
            self._prepared = known = Prepared(addresses, geometry, renderer, spectrum, has_unbaked)
        return known


def _require_differentials(ray: mi.RayDifferential3f) -> None:
    if not ray.has_differentials:
        what = "the lookup filters over a pixel, and the rays that it is given have no differentials"
        fix = f"make it the scene's integrator itself, or use lookup = '{_PIXEL}'"
        raise InputError(what, where=_WHERE, fix=fix)


def _nothing(
    found: mi.PreliminaryIntersection3f,  # noqa: ARG001
    ray: mi.RayDifferential3f,  # noqa: ARG001
) -> tuple[mi.Color3f, mi.UInt32]:
    return mi.Color3f(0), mi.UInt32(UNBAKED)


def _shaded(surfaces: Surfaces, kind: mi.UInt32, shades: list[Shade]) -> mi.Color3f:
    radiance = mi.Color3f(0)
    for index, shade in enumerate(shades):
        wanted = kind == index
        radiance += dr.if_stmt((surfaces,), wanted, shade, lambda _: mi.Color3f(0), label=f"surface_type_{index}")
    return radiance


def _rendering(variant: str) -> Rendering:
    """Rendering of a variant that vectorises and carries three colours or spectra."""
    device, _, kind = variant.partition("_ad_")
    if device not in backend.VARIANT_OF or kind not in _RENDERINGS:
        usable = ", ".join(f"llvm_ad_{name}" for name in _RENDERINGS)
        raise InputError(f"the variant {variant} is not supported", where=_WHERE, fix=f"set one of: {usable}, or cuda")
    return _RENDERINGS[kind]


def _nested(props: mi.Properties, *, hides: bool) -> mi.SamplingIntegrator:
    given = [value for _, value in props.objects()]
    if not given:
        return backend.load({"type": "path", "hide_emitters": hides})
    nested = given[0]
    fix = "nest path, direct or volpath"
    if len(given) > 1 or not isinstance(nested, mi.SamplingIntegrator) or isinstance(nested, mi.CppADIntegrator):
        raise InputError("takes one nested integrator that samples rays", where=_WHERE, fix=fix)
    if nested.aov_names():
        raise InputError("the nested integrator makes further layers", where=_WHERE, fix=f"nest {PLUGIN} in it instead")
    if hides and not nested.hide_emitters:
        raise InputError("the nested integrator shows emitters", where=_WHERE, fix="give it hide_emitters as well")
    return nested


def _named_bakes(props: mi.Properties) -> dict[str, Path]:
    """Path of each bake by shape id; `"*"` for all other shapes."""
    named = {name.removeprefix(_PREFIX): name for name in props.keys() if name.startswith(_PREFIX)}  # noqa: SIM118
    if "bake" in props:
        named["*"] = "bake"
    if not named:
        raise InputError("no bake", where=_WHERE, fix=f"give bake, or {_PREFIX}<shape id> for single shapes")
    return {shape: Path(str(mi.file_resolver().resolve(props[name]))) for shape, name in named.items()}


def _opened(path: Path, method: str | None) -> Bake:
    bake = open_bake(path)
    require_served(registration(method or default_method(bake)), bake)
    return bake


def _by_id(shapes: list[mi.Shape], bakes: dict[str, Bake]) -> dict[str, mi.Shape]:
    """Shapes that take bakes, by id; those without an id, or with that of another, by their number."""
    found: dict[str, mi.Shape] = {}
    for number, shape in enumerate(shapes):
        name = shape.id()
        if shape.is_emitter():
            if name in bakes:
                raise InputError(f"shape '{name}' is an emitter", where=_WHERE, fix=f"leave out {_PREFIX}{name}")
            continue
        if shape.class_name() == "Instance":  # cannot be loaded without its group: neither shaded nor an occluder
            continue
        found[name if name and name not in found else f"{name or 'shape'} ({number})"] = shape
    lost = [name for name in bakes if name != "*" and name not in found]
    if lost and not all(shape.id() for shape in shapes):
        raise InputError(
            f"no shape '{lost[0]}', but shapes without an id: Mitsuba merges meshes of one material",
            where=_WHERE,
            fix="check the id, or load the scene with optimize=False",
        )
    return found


@cache
def _class_of(variant: str) -> type:
    """Class with the methods of `BakedRadiance` and the integrator of the current variant as its base."""
    own = {name: member for name, member in vars(BakedRadiance).items() if name not in ("__dict__", "__weakref__")}
    return type(f"{BakedRadiance.__name__}_{variant}", (mi.SamplingIntegrator,), own)


@backend.on_variant
def register() -> None:
    """Register the integrator in the current variant."""
    mi.register_integrator(PLUGIN, _class_of(mi.variant()))


def register_plugins() -> None:
    """Make rsibr's Mitsuba plugins known in the current variant, and in every variant that is set from now on.

    Examples
    --------
    >>> rsibr.register_plugins()                                                                   # doctest: +SKIP
    >>> mi.set_variant("llvm_ad_rgb")                                                              # doctest: +SKIP
    >>> integrator = mi.load_dict({"type": "rsibr", "bake": "out/paint.rsibr"})                    # doctest: +SKIP
    >>> picture = mi.render(scene, integrator=integrator)                                          # doctest: +SKIP
    """
    _follow_variants()
    if mi.variant() is not None:
        _register_all()


@cache
def _follow_variants() -> None:
    mi.detail.add_variant_callback(lambda *_: _register_all())


def _register_all() -> None:
    for one in (blend.register, car_paint.register, register):
        one()
