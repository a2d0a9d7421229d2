"""Pictures of objects, from scene and bakes to a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.job_size import JobSize
from rsibr.methods.job import maps_memory
from rsibr.progress import Job
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.cameras.camera_choice import chosen_camera
from rsibr.shading.cameras.outside_views import outside_notes
from rsibr.shading.cameras.view_check import view_notes
from rsibr.shading.path_traced import path_traced_rest, unbaked_refusal
from rsibr.shading.pictures.picture import Picture
from rsibr.shading.pictures.picture_file import Origin, write_picture
from rsibr.shading.renderer import RAYS, ObjectRenderer, opened
from rsibr.shading.scenes.lit_scene import require_one_light
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shading.scenes.scene_file import open_scene
from rsibr.shading.surface_types import SurfaceTypes, lost_structure
from rsibr.shown_progress import shows_progress
from rsibr.store.bake import Bake
from rsibr.store.image_kind import image_kind

Scene = Path | str | dict[str, Any] | ObjectScene
Bakes = Bake | Path | str | Mapping[str, Bake | Path | str]
Occlusion = Literal["off", "auto", "on"]
OnProgress = Callable[[int, int], None]

PIXEL_BYTES = 256
"""Memory for each pixel of a picture: the sums of the kernel, the layers, and their file [bytes]."""
_NAMED = 12  # shapes that a note names


@dataclass(frozen=True, eq=False)
class RenderJob:
    """A scene with its bakes and settings, for any number of pictures.

    Attributes
    ----------
    scene : ObjectScene
        Scene.
    bakes : dict of str to Bake
        Bake of each shape id; `"*"` stands for all other shapes.
    method : str or None
        Method of all bakes; None: the default of each.
    rays : int
        Rays a pixel.
    lookup : str
        How a surface takes its radiance from the method.
    occlusion : {"off", "auto", "on"}
        Whether the object hides the sky from itself.
    notes : tuple of str
        What a user should know about the bakes and shapes, in a sentence each.
    environment_distance : float or None
        Distance [scene units] from the object to what surrounds it; None: unknown, or far.
    """

    scene: ObjectScene
    bakes: dict[str, Bake]
    method: str | None
    rays: int
    lookup: str
    occlusion: Occlusion
    notes: tuple[str, ...]
    environment_distance: float | None = None

    @classmethod
    def opened(
        cls,
        scene: Scene,
        bakes: Bakes,
        *,
        method: str | None = None,
        rays: int = RAYS,
        lookup: str = "pixel",
        occlusion: Occlusion = "auto",
        strict: bool = False,
        environment_distance: float | None = None,
    ) -> RenderJob:
        """Open scene and bakes, and refuse what cannot be shown; parameters as for `render`."""
        if environment_distance is not None and not environment_distance > 0:
            what = f"a distance of {environment_distance:g}"
            raise InputError(what, where="environment_distance", fix="give a positive number of scene units")
        with backend.session():
            held = {name: opened(bake) for name, bake in _by_shape(bakes).items()}
            shapes = scene if isinstance(scene, ObjectScene) else open_scene(scene)
            notes = _notes(shapes, held, strict)
        return cls(shapes, held, method, rays, lookup, occlusion, notes, environment_distance)

    @cached_property
    def renderer(self) -> ObjectRenderer:
        """Renderer of the shapes with a bake, prepared at its first use."""
        with backend.session():
            return ObjectRenderer(
                self.scene,
                self.bakes,
                self.method,
                self.lookup,
                occlusion=self.occlusion,
                environment_distance=self.environment_distance,
            )

    def size(self, camera: Camera) -> JobSize:
        """Forecast of a picture."""
        bakes = {bake.path: bake for bake in self.bakes.values()}.values()
        memory = sum(maps_memory(bake) for bake in bakes) + PIXEL_BYTES * camera.width * camera.height
        return JobSize(f"picture of {camera.width}×{camera.height}", memory=memory)

    def picture(self, camera: Camera, *, rays: int | None = None, seed: int = 0, is_single: bool = False) -> Picture:
        """Render all shapes: those with a bake from it, the others by path tracing.

        Parameters
        ----------
        camera : Camera
            Camera.
        rays : int, optional
            Rays a pixel, if others than the job's.
        seed : int
            Of the path tracing.
        is_single : bool
            Whether it is the only picture, which must show the object; see `view_notes`.
        """
        count = self.rays if rays is None else rays
        with backend.session():
            made = self.renderer.picture(camera, count)
            if self.renderer.types.unbaked(self.scene):
                rest = path_traced_rest(self.scene, self.renderer.types, self.bakes, camera, count, seed)
                made = with_rest(made, *rest)
            seen = view_notes(made, self.scene, camera, is_single=is_single)
            stored = [bake.viewpoints for bake in self.bakes.values()]
            outside = outside_notes(self.scene, self.renderer.types, stored, camera)
        return replace(made, notes=tuple(dict.fromkeys((*self.notes, *seen, *outside, *made.notes))))

    def origin(self, camera: Camera) -> Origin:
        """What a picture of a camera is made of, for its header."""
        names, methods = self.renderer.types.names, self.renderer.methods
        return Origin(
            camera,
            {name: bake.path.name for name, bake in self.bakes.items()},
            {name: method.name for name, method in zip(names, methods, strict=True)},
            {"rays": self.rays, "lookup": self.lookup, "occlusion": self.occlusion},
        )


@shows_progress(Job("render", "pictures"))
def render(
    scene: Scene,
    bakes: Bakes,
    *,
    method: str | None = None,
    camera: Camera | Mapping[str, Any] | None = None,
    resolution: int | tuple[int, int] | None = None,
    rays: int = RAYS,
    lookup: str = "pixel",
    occlusion: Occlusion = "auto",
    strict: bool = False,
    environment_distance: float | None = None,
    out: Path | str | None = None,
    exposure: float | None = None,
    on_progress: OnProgress | None = None,
    on_forecast: Callable[[JobSize], None] | None = None,
    allow_large: bool = False,
) -> Picture:
    """Render an object from bakes.

    Parameters
    ----------
    scene : path, dict, str or ObjectScene
        Mitsuba scene (XML file or dictionary), mesh file, or `"sphere"`. Its emitters, and the BSDFs of shapes that
        have a bake, are not used.
    bakes : Bake, path, or mapping of str to Bake or path
        One for all shapes, or the bake of each shape id; `"*"` stands for all shapes that no other id names.
    method : str, optional
        Name of a method, one of `rsibr.method_names()`; by default that of `rsibr.reconstruct`.
    camera : Camera or mapping, optional
        A mapping has `position`, `target` and `up`, or `direction` (from the object to the camera), and `fov_deg`.
        By default the scene's camera, else one that sees the whole object.
    resolution : int or (int, int), optional
        Pixels a side, or width and height; by default the camera's, or 512.
    rays : int
        Rays a pixel, 1 to 4096.
    lookup : str
        How a surface takes its radiance from the method, one of `rsibr.shading.lookups.registry.lookups`, with values
        of options if any, `NAME,OPTION=VALUE`; "auto": the cheapest that the perspective allows.
    occlusion : {"auto", "off", "on"}
        Whether the object hides the sky from itself; "auto" decides by the scene.
    strict : bool
        Refuse shapes without a bake. By default they are path-traced under the bakes' environment.
    environment_distance : float, optional
        Distance [scene units] from the object to what surrounds it, such as the walls of the room of the environment
        map. Bakes are lit from infinity; with a distance, a note says whether the object is too large for that.
    out : path, optional
        File to write, `.exr` or `.png`; see `rsibr.shading.pictures.picture_file.write_picture`.
    exposure : float, optional
        Exposure of a PNG [stops]: 0 shows radiance 1 as white. By default chosen from the picture.
    on_progress : callable, optional
        Called with pictures done and in all.
    on_forecast : callable, optional
        Called once with the memory of the job before the picture is made.
    allow_large : bool
        Start even if maps and picture exceed the free memory.

    Returns
    -------
    Picture
        Radiance, alpha, depth, normals; what was left out in `notes`.

    Raises
    ------
    InputError
        If scene, shape ids, method, camera, size or file name are wrong, a shape without a bake is refused, the memory
        is too small, nothing of the object is in the picture, or the camera is inside of it.
    BakeError
        If a bake cannot be read, or lacks something that the method requires.

    Examples
    --------
    >>> picture = rsibr.render("sphere", "out/paint.rsibr", resolution=256, out="out/sphere.png")   # doctest: +SKIP
    >>> picture.radiance.shape                                                                      # doctest: +SKIP
    (256, 256, 3)
    """
    factor = exposure_factor(exposure)
    if out is not None:
        image_kind(out)
    job = RenderJob.opened(
        scene,
        bakes,
        method=method,
        rays=rays,
        lookup=lookup,
        occlusion=occlusion,
        strict=strict,
        environment_distance=environment_distance,
    )
    view = chosen_camera(job.scene, camera, resolution)
    size, show = job.size(view), on_progress or (lambda _done, _total: None)
    if on_forecast is not None:
        on_forecast(size)
    size.admit(out, allow_large)
    show(0, 1)
    picture = job.picture(view, is_single=True)
    if out is not None:
        write_picture(picture, out, exposure=factor, origin=job.origin(view))
    show(1, 1)
    return picture


def exposure_factor(stops: float | None) -> float | None:
    """Factor on radiance of an exposure in stops; None stays None.

    Raises
    ------
    InputError
        If it is no number from −64 to 64.
    """
    if stops is None:
        return None
    if not -64 <= stops <= 64:
        raise InputError(f"an exposure of {stops:g}", where="exposure", fix="give stops from -64 to 64")
    return float(2.0**stops)


def with_rest(picture: Picture, radiance: NDArray[np.float32], alpha: NDArray[np.float32]) -> Picture:
    """Add the surfaces that no bake shades: a ray meets one or the other, so both coverages add up.

    Parameters
    ----------
    picture : Picture
        Surfaces with a bake.
    radiance : ndarray, shape (H, W, 3)
        Of the others [W sr⁻¹ m⁻²], premultiplied by `alpha`.
    alpha : ndarray, shape (H, W)
        Share of the pixel's rays that meet one of the others.
    """
    return replace(
        picture,
        radiance=(picture.radiance + radiance).astype(np.float32),
        alpha=np.minimum(picture.alpha + alpha, 1).astype(np.float32),
    )


def _by_shape(bakes: Bakes) -> dict[str, Bake | Path | str]:
    if not isinstance(bakes, Mapping):
        return {"*": bakes}
    if not bakes:
        raise InputError("no bake", where="bakes", fix="give a bake, or one for each shape id")
    return dict(bakes)


def _notes(scene: ObjectScene, bakes: Mapping[str, Bake], strict: bool) -> tuple[str, ...]:
    """Notes on shapes without a bake and on the light of the bakes; InputError for what cannot be shown."""
    types = SurfaceTypes.assign(scene, list(bakes))
    lost = tuple(note for name in types.of_shape if (note := lost_structure(name, scene.shapes[name].bsdf())))
    refusal = unbaked_refusal(scene, types)
    if refusal is not None:
        if strict:
            raise refusal
        require_one_light(bakes)
        bare = types.unbaked(scene)
        named = ", ".join(bare[:_NAMED]) + (f" and {len(bare) - _NAMED} more" if len(bare) > _NAMED else "")
        return (*lost, f"path-traced, for want of a bake: {named}; they have no depth and no normals in the file")
    try:
        require_one_light(bakes)
    except InputError as error:
        return (*lost, error.what)
    return lost
