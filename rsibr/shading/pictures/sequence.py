"""Sequences of pictures: numbered files or a film, made in one go or gone on with."""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from rsibr.errors import InputError
from rsibr.job_size import JobSize
from rsibr.machine import make_folder
from rsibr.methods.registry import default_method, method_digest
from rsibr.progress import Job
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.cameras.camera_choice import chosen_camera
from rsibr.shading.cameras.camera_path import MOST_FRAMES, along_path, read_path, turntable
from rsibr.shading.pictures.film_file import check_ffmpeg, write_film
from rsibr.shading.pictures.picture import Picture
from rsibr.shading.pictures.picture_file import camera_record, encode_exr, exposure_of_pictures, on_black
from rsibr.shading.pictures.picture_file import display as as_png
from rsibr.shading.pictures.sequence_record import SequenceRecord, read_record, write_record
from rsibr.shading.render import Bakes, Occlusion, OnProgress, RenderJob, Scene, exposure_factor
from rsibr.shading.renderer import RAYS
from rsibr.shading.scenes.object_scene import ObjectScene
from rsibr.shown_progress import shows_progress
from rsibr.source_code import source_digest
from rsibr.store.atomic import checksum, file_checksum, write_atomic
from rsibr.store.image_kind import image_kind
from rsibr.store.png_file import encode_png

FILM = "mp4"
_EXR_BYTES, _PNG_BYTES = 32, 4  # of a pixel
_NUMBER = re.compile(r"#+|%0(\d)d")
_TRIALS, _TRIAL_SIDE, _TRIAL_RAYS = 8, 96, 4
"""Frames, pixels and rays of the small pictures that the exposure of a sequence is chosen from."""


@dataclass(frozen=True)
class RenderedSequence:
    """What a sequence became.

    Attributes
    ----------
    files : tuple of Path
        Files of the frames, or the film.
    frames : int
        Number of frames.
    kept : int
        Frames of earlier runs.
    seconds : float
        Wall time of this run, preparation and files included [s].
    exposure : float or None
        Factor on radiance of all frames; None for EXR.
    notes : tuple of str
        What was left out or ignored, in a sentence each.
    """

    files: tuple[Path, ...]
    frames: int
    kept: int
    seconds: float
    exposure: float | None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FrameFiles:
    """Names of the files of a sequence.

    Attributes
    ----------
    out : Path
        What was asked for.
    kind : str
        `"exr"`, `"png"` or `"mp4"`.
    frames : int
        Number of frames.
    """

    out: Path
    kind: str
    frames: int

    @classmethod
    def of(cls, out: Path | str, frames: int) -> FrameFiles:
        """Names for a file name; InputError if its ending is another, or its folder has the number."""
        path = Path(out)
        return cls(path, image_kind(path, (FILM,)), frames)

    @property
    def folder(self) -> Path:
        """Folder of the frames: that of the file; of a film one beside it, named after it."""
        return self.out.with_name(f"{self.out.name}.frames") if self.kind == FILM else self.out.parent

    @property
    def sidecar(self) -> Path:
        """File that says how each frame was made."""
        if self.kind == FILM:
            return self.folder / "frames.json"
        return self.out.with_name(f"{_NUMBER.sub('', self.out.stem).rstrip('_-.') or 'frames'}.{self.kind}.json")

    def frame(self, index: int) -> Path:
        """File of a frame, counted from 1 in its name."""
        if self.kind == FILM:
            return self.folder / f"{index + 1:06d}.png"
        stem, digits = self.out.stem, max(4, len(str(self.frames)))
        marks = list(_NUMBER.finditer(stem))
        if not marks:
            return self.out.with_name(f"{stem}_{index + 1:0{digits}d}{self.out.suffix}")
        mark = marks[-1]
        digits = int(mark.group(1) or len(mark.group()))
        return self.out.with_name(f"{stem[: mark.start()]}{index + 1:0{digits}d}{stem[mark.end() :]}{self.out.suffix}")


@shows_progress(Job("render", "frames"))
def render_sequence(
    scene: Scene,
    bakes: Bakes,
    *,
    out: Path | str,
    frames: int,
    path: Path | str | None = None,
    method: str | None = None,
    camera: Camera | Mapping[str, Any] | None = None,
    resolution: int | tuple[int, int] | None = None,
    rays: int = RAYS,
    lookup: str = "pixel",
    occlusion: Occlusion = "auto",
    strict: bool = False,
    environment_distance: float | None = None,
    exposure: float | None = None,
    fresh: bool = False,
    on_progress: OnProgress | None = None,
    on_forecast: Callable[[JobSize], None] | None = None,
    allow_large: bool = False,
) -> RenderedSequence:
    """Render a turntable, or a flight along a path, into numbered files or a film.

    Frames of an earlier run with the same settings are kept, so that a killed run goes on where it was.

    Parameters
    ----------
    scene, bakes, method, camera, resolution, rays, lookup, occlusion
        As for `rsibr.render`.
    strict, environment_distance, exposure, on_forecast, allow_large
        As for `rsibr.render`. The exposure is one for all frames.
    out : path
        `name.exr`, `name.png`: numbered files `name_0001.exr` and so on, or with the number where `#` or `%04d` stands.
        `name.mp4`: a film of 24 frames a second, by ffmpeg; its frames are kept in `name.mp4.frames`.
    frames : int
        Number of frames. Without a path they go once around the middle of the object, about +Y.
    path : path, optional
        JSON list of cameras; see `rsibr.shading.cameras.camera_path.read_path`.
    fresh : bool
        Make all frames anew.
    on_progress : callable, optional
        Called with frames done and in all.

    Returns
    -------
    RenderedSequence

    Raises
    ------
    InputError, BakeError
        As `rsibr.render`.
    MachineError
        If a film is asked for and there is no ffmpeg, or the disk is full.

    Examples
    --------
    >>> turn = rsibr.render_sequence("car.xml", "out/paint.rsibr", out="out/turn.png", frames=36)    # doctest: +SKIP
    >>> len(turn.files)                                                                              # doctest: +SKIP
    36
    """
    start, factor = time.perf_counter(), exposure_factor(exposure)
    files = _checked_files(out, frames)
    record = SequenceRecord() if fresh else read_record(files.sidecar)
    keys = None if path is None else read_path(Path(path))
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
    first = chosen_camera(job.scene, camera, resolution)
    cameras = turntable(first, job.scene.centre, frames) if keys is None else along_path(keys, first, frames)
    size = _sequence_size(job.size(first), files, first)
    if on_forecast is not None:
        on_forecast(size)
    size.admit(out, allow_large)
    settings = _settings(job)
    if files.kind != "exr" and factor is None:
        factor = _known_exposure(record, settings, cameras) or _common_exposure(job, cameras)
        record = replace(record, exposure=factor, exposed_by=_exposed_by(settings, cameras))
    make_folder(files.folder)
    maker = _Frames(files, _digest(settings, factor), record)
    kept, notes = maker.make(job, cameras, factor, on_progress or (lambda _done, _total: None))
    made = tuple(files.frame(index) for index in range(frames))
    if files.kind == FILM:
        maker.write_film(made)
        made = (files.out,)
    return RenderedSequence(made, frames, kept, time.perf_counter() - start, factor, notes)


@dataclass(eq=False)
class _Frames:
    """Frames on the disk, and the record of how each was made."""

    files: FrameFiles
    settings: str
    record: SequenceRecord

    def make(
        self, job: RenderJob, cameras: list[Camera], exposure: float | None, show: OnProgress
    ) -> tuple[int, tuple[str, ...]]:
        """Make the frames that are missing; return how many were not, and the notes of the pictures."""
        known, entries, kept, notes = dict(self.record.frames), dict[str, dict[str, str]](), 0, dict[str, None]()
        for index, camera in enumerate(cameras):
            show(index, len(cameras))
            file, made_by = self.files.frame(index), _digest(self.settings, camera_record(camera), index)
            entry = known.get(file.name)
            if entry is not None and entry["made_by"] == made_by and _holds(file, entry["sha256"]):
                kept += 1
            else:
                picture = job.picture(camera, seed=index)
                notes |= dict.fromkeys(picture.notes)
                data = self._encoded(job, camera, picture, exposure)
                write_atomic(file, data)
                entry = {"made_by": made_by, "sha256": checksum(data)}
                known[file.name] = entry
                self._keep(known)
            entries[file.name] = entry
        if entries != self.record.frames:
            self._keep(entries)
        show(len(cameras), len(cameras))
        return kept, tuple(notes) or job.notes

    def write_film(self, frames: tuple[Path, ...]) -> None:
        """Encode the film, unless it is there and of these frames."""
        made_by = _digest(*(entry["sha256"] for entry in self.record.frames.values()))
        film = self.record.film
        if film is None or film["made_by"] != made_by or not _holds(self.files.out, film["sha256"]):
            write_film(frames, self.files.out)
            self.record = replace(self.record, film={"made_by": made_by, "sha256": file_checksum(self.files.out)})
            write_record(self.files.sidecar, self.record)

    def _keep(self, frames: dict[str, dict[str, str]]) -> None:
        self.record = replace(self.record, frames=dict(frames))
        write_record(self.files.sidecar, self.record)

    def _encoded(self, job: RenderJob, camera: Camera, picture: Picture, exposure: float | None) -> bytes:
        if self.files.kind == "exr":
            return encode_exr(picture, job.origin(camera))
        return encode_png((on_black if self.files.kind == FILM else as_png)(picture, exposure or 1.0))


def _checked_files(out: Path | str, frames: int) -> FrameFiles:
    """Names of the files; InputError or MachineError for what cannot be made, before any work."""
    if not 1 <= frames <= MOST_FRAMES:
        raise InputError(f"{frames} frames", where="frames", fix=f"give 1 to {MOST_FRAMES}")
    files = FrameFiles.of(out, frames)
    if files.kind == FILM:
        check_ffmpeg()
    return files


def _sequence_size(picture: JobSize, files: FrameFiles, camera: Camera) -> JobSize:
    """Forecast of all frames: the memory of one, and the disk of all if nothing could be compressed."""
    disk = files.frames * camera.width * camera.height * (_EXR_BYTES if files.kind == "exr" else _PNG_BYTES)
    return replace(picture, name=f"sequence of {files.frames} frames", disk=disk)


def _common_exposure(job: RenderJob, cameras: list[Camera]) -> float:
    """One exposure for all frames, from small pictures of some: the same whenever it is chosen."""
    chosen = [cameras[index] for index in np.unique(np.linspace(0, len(cameras) - 1, _TRIALS).astype(int))]
    scale = min(1.0, _TRIAL_SIDE / max(chosen[0].width, chosen[0].height))
    small = [replace(one, width=_scaled(one.width, scale), height=_scaled(one.height, scale)) for one in chosen]
    return exposure_of_pictures([job.picture(one, rays=_TRIAL_RAYS) for one in small])


def _scaled(pixels: int, scale: float) -> int:
    return max(1, round(pixels * scale))


def _known_exposure(record: SequenceRecord, settings: str, cameras: list[Camera]) -> float | None:
    """Exposure of an earlier run with the same settings and cameras: it need not be chosen again."""
    return record.exposure if record.exposed_by == _exposed_by(settings, cameras) else None


def _exposed_by(settings: str, cameras: list[Camera]) -> str:
    return _digest(settings, [camera_record(camera) for camera in cameras])


def _settings(job: RenderJob) -> str:
    """Digest of all that decides the frames but their cameras and exposure: code, geometry, bakes, methods, settings.

    Nothing is prepared for it, so that a sequence that is complete ends at once.
    """
    return _digest(
        {
            "code": source_digest("rsibr.shading", "rsibr.methods"),
            "geometry": geometry_digest(job.scene),
            "bakes": {name: bake.manifest.identity for name, bake in job.bakes.items()},
            "maps": {name: [view.sha256 for view in bake.manifest.views] for name, bake in job.bakes.items()},
            "methods": [method_digest(job.method or default_method(bake)) for bake in job.bakes.values()],
            "settings": [job.rays, job.lookup, job.occlusion],
        }
    )


def _digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


def geometry_digest(scene: ObjectScene) -> str:
    """SHA-256 over the shapes of a scene with their materials: all that Mitsuba lets one traverse."""
    digest = hashlib.sha256()
    for name, shape in scene.shapes.items():
        digest.update(f"{name} {shape.class_name()}\n".encode())
        values = mi.traverse(shape)
        for key in sorted(values.keys()):
            value = values[key]
            held = str(value) if isinstance(value, str) or not hasattr(value, "__len__") else np.array(value).tobytes()
            digest.update(key.encode() + (held.encode() if isinstance(held, str) else held))
    return digest.hexdigest()


def _holds(file: Path, sha256: str) -> bool:
    """Whether the file is there, unchanged."""
    return file.is_file() and file_checksum(file) == sha256
