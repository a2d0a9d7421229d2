"""Validation of pictures of an object: errors of every method against open shading and against path tracing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rsibr import backend
from rsibr.errors import InputError
from rsibr.job_size import JobSize
from rsibr.methods.registry import available, method_names, registration
from rsibr.progress import Job
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.pictures.picture import Image, Picture
from rsibr.shading.renderer import RAYS, ObjectRenderer, opened
from rsibr.shading.scenes.lit_scene import prepared_scenes, require_one_light
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.surface_types import SurfaceTypes
from rsibr.shown_progress import shows_progress
from rsibr.store.bake import Bake
from rsibr.validation.equal_error import path_tracing_seconds
from rsibr.validation.flip import Exposures, exposures_for
from rsibr.validation.objects.causes import Truths, causes_of
from rsibr.validation.objects.job import TRUTHS, object_job
from rsibr.validation.objects.object_error import ObjectError, object_error
from rsibr.validation.objects.primary_rays import PrimaryRays
from rsibr.validation.objects.results import MethodPicture, ObjectValidation
from rsibr.validation.objects.truths import ObjectTruths
from rsibr.validation.objects.zones import Mask, zones_of
from rsibr.validation.reference import MINIMUM_BUFFERS, Reference
from rsibr.validation.report.object_report import write_object_report
from rsibr.validation.validation import DEFAULT_SAMPLES, bake_summary

SIDE = 256
"""Pixels a side where none are given: enough for errors, and minutes of path tracing less than a picture to look at."""


@shows_progress(Job("validate"))
@backend.in_session
def validate_object(
    scene: ObjectScene,
    bakes: Mapping[str, Bake | Path | str],
    *,
    camera: Camera | None = None,
    methods: Sequence[str] | None = None,
    lookup: str = "pixel",
    occlusion: str = "auto",
    rays: int = RAYS,
    samples: int = DEFAULT_SAMPLES,
    buffers: int = MINIMUM_BUFFERS,
    out: Path | str | None = None,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
    on_forecast: Callable[[JobSize], None] = lambda _: None,
    allow_large: bool = False,
) -> ObjectValidation:
    """Compare pictures of an object with open shading, shadows without bounces, and path tracing.

    Parameters
    ----------
    scene : ObjectScene
        Shapes. Those without a bake hide what is behind them, shadow and light the others, and are not judged.
    bakes : mapping of str to Bake or path
        Bake of each shape by its id; `"*"` stands for all other shapes. All lit by one environment, in RGB.
    camera : Camera, optional
        Camera; by default the scene's.
    methods : sequence of str, optional
        Methods; by default all whose requirements every bake meets.
    lookup : str
        How surfaces take their radiance, see `rsibr.shading.lookups.registry`.
    occlusion : {"auto", "on", "off"}
        Whether the pictures held against path tracing hide the sky from themselves, see `ObjectRenderer`. Those held
        against open shading never do.
    rays : int
        Rays a pixel, of pictures and truths.
    samples : int
        Minimum samples a pixel of each truth, total of all buffers; at least one a ray and buffer is taken.
    buffers : int
        Independent buffers of a truth, at least 8.
    out : path, optional
        Directory for `report.html`, `object.json` and the images.
    on_progress : callable
        Called with the number of steps done and the total: truths and pictures.
    on_forecast : callable
        Called once with memory and time before the work begins.
    allow_large : bool
        Start even if the validation exceeds the free memory.

    Returns
    -------
    ObjectValidation
        Errors with their intervals, by zone and by cause.

    Raises
    ------
    InputError
        If a method, an option or a shape id is unknown, there is no camera, the bakes have different lights or are
        spectral, nothing of the scene with a bake is in the picture, or the memory is too small.
    BakeError
        If a bake cannot be read, or its inputs have changed since.
    CheckFailed
        If a picture or a truth has NaN or Inf.
    """
    on_progress, on_forecast = backend.unlocked(on_progress), backend.unlocked(on_forecast)
    # ---- Check ----
    given = {name: opened(bake) for name, bake in bakes.items()}
    _require_rgb(given)
    require_one_light(given)
    names = _methods(given, methods)
    primary = _primary(scene, given, camera or scene.camera, rays)
    _require_buffers(buffers)
    may_shadow = occlusion != "off" and (len(scene.shapes) > 1 or any(one.is_mesh() for one in scene.shapes.values()))
    job = object_job(primary, given, len(names), samples, buffers, has_shadows=may_shadow)
    job.admit(None, allow_large)
    on_forecast(job)
    renderers = {name: _renderers(scene, given, name, lookup, occlusion) for name in names}  # fail before the truths
    # ---- Truths ----
    truths = _truths(primary, given, samples, buffers, lambda done: on_progress(done, TRUTHS + len(names)))
    zones = zones_of(primary.layers, primary.camera)
    exposures = exposures_for(float(truths.open.mean[truths.open.coverage > 0].mean()))
    # ---- Pictures ----
    made: dict[str, MethodPicture] = {}
    for done, (name, of_method) in enumerate(renderers.items()):
        on_progress(TRUTHS + done, TRUTHS + len(names))
        made[name] = _judged(of_method, primary, truths, zones, exposures, name)
    on_progress(TRUTHS + len(names), TRUTHS + len(names))
    validation = ObjectValidation(
        scene=scene.name,
        camera=primary.camera,
        rays=rays,
        lookup=lookup,
        occlusion=occlusion,
        surfaces={name: bake_summary(bake) for name, bake in given.items()},
        zones=zones,
        truths=truths,
        causes=causes_of(truths),
        methods=made,
        exposures=exposures,
        plan=renderers[names[0]][1].plan,
        notes=(*scene.notes, *_notes(primary)),
    )
    if out is not None:
        write_object_report(validation, Path(out))
    return validation


def _truths(
    primary: PrimaryRays, bakes: dict[str, Bake], samples: int, buffers: int, on_step: Callable[[int], None]
) -> Truths:
    prepared = prepared_scenes(bakes)
    seed = int(next(iter(bakes.values())).config["sampling"]["seed"])
    truth = ObjectTruths(primary, bakes, prepared, samples, buffers, seed)

    def made(step: int, make: Callable[[], Reference]) -> Reference:
        on_step(step)
        return make()

    return Truths(
        open=made(0, truth.open),
        one_map=made(1, truth.one_map),
        shadowed=made(2, truth.shadowed),
        full=made(3, truth.full),
        all_over=made(4, truth.open_all_over),
        bent=primary.bent,
    )


def _renderers(
    scene: ObjectScene, bakes: dict[str, Bake], method: str, lookup: str, occlusion: str
) -> tuple[ObjectRenderer, ObjectRenderer]:
    """Renderers of the picture without shadows of its own, and of the picture as asked for."""
    asked = ObjectRenderer(scene, bakes, method, lookup, occlusion=occlusion)
    return asked if occlusion == "off" else asked.with_occlusion("off"), asked


def _judged(
    renderers: tuple[ObjectRenderer, ObjectRenderer],
    primary: PrimaryRays,
    truths: Truths,
    zones: dict[str, Mask],
    exposures: Exposures,
    name: str,
) -> MethodPicture:
    without, asked = renderers
    picture, compile_seconds = _picture(asked, primary)  # first, so that it prepares all that it needs
    bare = picture if asked is without else _picture(without, primary)[0]

    def error(of: Picture, truth: Reference) -> ObjectError:
        return object_error(_without_coverage(of), truth, zones, exposures, name)

    unoccluded = error(bare, truths.full)
    full = unoccluded if asked is without else error(picture, truths.full)
    open_error, traced = error(bare, truths.open), truths.open
    of_equal_error = path_tracing_seconds(
        open_error.whole.rel_mse, open_error.noise_floor, traced.samples, traced.seconds
    )
    return MethodPicture(picture, bare, open_error, full, unoccluded, compile_seconds, of_equal_error)


def _picture(renderer: ObjectRenderer, primary: PrimaryRays) -> tuple[Picture, float]:
    """Picture, and how much longer the first one took [s]."""
    first = renderer.picture(primary.camera, primary.rays)
    picture = replace(renderer.picture(primary.camera, primary.rays), prepare_seconds=first.prepare_seconds)
    return picture, max(0.0, first.seconds - picture.seconds)


def _without_coverage(picture: Picture) -> Image:
    alpha = picture.alpha[..., None]
    return np.divide(picture.radiance, alpha, out=np.zeros_like(picture.radiance), where=alpha > 0)


def _primary(scene: ObjectScene, bakes: dict[str, Bake], camera: Camera | None, rays: int) -> PrimaryRays:
    if camera is None:
        raise InputError("no camera", where=scene.name, fix="give one")
    primary = PrimaryRays(scene, SurfaceTypes.assign(scene, list(bakes)), camera, rays)
    if not len(primary.pixels):
        raise InputError("no surface with a bake is in the picture", where=scene.name, fix="move the camera")
    return primary


def _methods(bakes: dict[str, Bake], wanted: Sequence[str] | None) -> list[str]:
    everywhere = [available(bake) for bake in bakes.values()]
    usable = [name for name in everywhere[0] if all(name in others for others in everywhere)]
    names = [registration(name).name for name in dict.fromkeys(usable if wanted is None else wanted)]
    if not names:
        raise InputError("no method given", where="method", fix=f"there are: {', '.join(method_names())}")
    return names


def _require_rgb(bakes: dict[str, Bake]) -> None:
    for name, bake in bakes.items():
        if bake.rendering != "rgb":
            raise InputError(
                f"the bake of '{name}' was rendered in {bake.rendering}, and objects are path-traced in RGB",
                where=str(bake.path),
                fix="bake it with effects.spectral and effects.polarisation off, or validate its maps without --object",
            )


def _require_buffers(buffers: int) -> None:
    if buffers < MINIMUM_BUFFERS:
        raise InputError(f"{buffers} buffers are too few to tell noise from error", fix="ask for 8 or more")


def _notes(primary: PrimaryRays) -> list[str]:
    found = []
    unbaked = primary.types.unbaked(primary.scene)
    if unbaked:
        found.append(f"not judged, without a bake: {', '.join(unbaked)}")
    dropped = int(((primary.layers.alpha > 0) & (primary.coverage == 0)).sum())
    if dropped:
        found.append(f"not judged: {dropped} pixels with a shading normal without direction, NaN in Mitsuba")
    return found
