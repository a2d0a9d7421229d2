"""`capture.json`: photographs of a painted sphere, with cameras and outlines, as a user or a program writes it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rsibr.capture.cameras.conventions import pose_of
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.maps.colmap import colmap_cameras
from rsibr.capture.photographs.exposure import Exposure
from rsibr.errors import InputError
from rsibr.regular_file import read_regular

Number = Annotated[float, Field(allow_inf_nan=False)]
Triple = tuple[Number, Number, Number]
_MOST = 10_000


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ExposureDocument(_Part):
    """Settings of a shot; without them, what EXIF says."""

    seconds: Number
    f_number: Number = 1.0
    iso: Number = 100.0

    def exposure(self) -> Exposure:
        """The exposure."""
        return Exposure(self.seconds, self.f_number, self.iso)


class ShotDocument(_Part):
    """One photograph of a bracket."""

    file: str
    exposure: ExposureDocument | None = None


class SphereDocument(_Part):
    """Sphere in the world of the poses."""

    centre: Triple
    radius: Annotated[Number, Field(gt=0)]


class PhotographDocument(_Part):
    """One view: `file`, a merged or single photograph, or `shots`, a bracket; its camera; and the sphere's outline."""

    file: str | None = None
    shots: tuple[ShotDocument, ...] = ()
    image: str | None = None
    width: Annotated[int, Field(ge=1)] | None = None
    height: Annotated[int, Field(ge=1)] | None = None
    intrinsics: tuple[Number, Number, Number, Number] | None = None
    pose: tuple[tuple[Number, Number, Number, Number], ...] | None = None
    mask: str | None = None
    circle: Triple | None = None
    points: tuple[tuple[Number, Number], ...] | None = None
    silhouette: Literal["found"] | None = None


class CaptureDocument(_Part):
    """The whole file; see docs/how-to/capture-maps.md."""

    schema_version: Literal[1] = Field(1, alias="schema")
    convention: str | None = None
    colmap: str | None = None
    sphere: SphereDocument | None = None
    gain: Annotated[Number, Field(gt=0)] = 1.0
    photographs: tuple[PhotographDocument, ...] = Field((), max_length=_MOST)


class NamedPhotograph(_Part):
    """A photograph of the document with its camera in the world of the poses."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    name: str
    camera: Pinhole
    said: PhotographDocument


def read_document(path: Path) -> CaptureDocument:
    """Read the file.

    Raises
    ------
    InputError
        If it cannot be read, is no JSON, or holds something unknown.
    """
    try:
        return CaptureDocument.model_validate(json.loads(read_regular(path).decode("utf-8")))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path)) from None
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(f"{place}: {first['msg']}", where=str(path), fix="see docs/how-to/capture-maps.md") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not JSON: {error}", where=str(path)) from None


def named_photographs(document: CaptureDocument, path: Path) -> list[NamedPhotograph]:
    """Photographs with their cameras.

    Raises
    ------
    InputError
        If the document names no photograph, or too little of a camera.
    """
    if document.colmap is not None:
        return _of_colmap(document, path)
    if not document.photographs:
        raise InputError("names no photographs", where=str(path), fix="list them as photographs")
    if document.convention is None:
        fix = "name opencv, opengl or colmap; it is never guessed"
        raise InputError("names no convention of its poses", where=str(path), fix=fix)
    return [
        NamedPhotograph(name=_name(one, k), camera=_camera(one, document.convention, path, k), said=one)
        for k, one in enumerate(document.photographs)
    ]


def _of_colmap(document: CaptureDocument, path: Path) -> list[NamedPhotograph]:
    cameras = colmap_cameras(path.parent / str(document.colmap))
    wanted = document.photographs or tuple(PhotographDocument(file=name) for name in cameras)
    found = []
    for k, one in enumerate(wanted):
        image = one.image or one.file or (one.shots[0].file if one.shots else "")
        camera = cameras.get(image) or cameras.get(Path(image).name)
        if camera is None:
            fix = "name the image as images.txt does"
            raise InputError(f"photograph {k}: COLMAP has no image '{image}'", where=str(path), fix=fix)
        found.append(NamedPhotograph(name=_name(one, k), camera=camera, said=one))
    return found


def _name(one: PhotographDocument, index: int) -> str:
    return one.image or one.file or (one.shots[0].file if one.shots else f"photograph {index}")


def _camera(one: PhotographDocument, convention: str, path: Path, index: int) -> Pinhole:
    where = f"{path}: photograph {index}"
    if one.pose is None or one.intrinsics is None or one.width is None or one.height is None:
        fix = "give width, height, intrinsics (fx, fy, cx, cy) and pose, or the folder of COLMAP's text files as colmap"
        raise InputError("says too little of its camera", where=where, fix=fix)
    try:
        position, axes = pose_of(np.array(one.pose), convention)
        focal, principal = np.array(one.intrinsics[:2]), np.array(one.intrinsics[2:])
        return Pinhole(one.width, one.height, focal, principal, position, axes)
    except InputError as error:
        raise InputError(error.what, where=f"{where}: {error.where}", fix=error.fix) from None
