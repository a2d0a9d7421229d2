"""Photograph of a capture as that of a sphere of radius 1 about the origin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.balls.ball_photograph import BallPhotograph
from rsibr.capture.brackets.hdr_image import HdrImage
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.curves.curve import Curve
from rsibr.capture.hdr import capture_hdr
from rsibr.capture.linear_image import linear_image
from rsibr.capture.maps.document import NamedPhotograph, PhotographDocument, SphereDocument
from rsibr.capture.silhouette.cone import Cone, fitted_cone
from rsibr.capture.silhouette.found import found_cone
from rsibr.capture.silhouette.marks import circle_places, mask_places
from rsibr.errors import InputError

OFF_PIXELS = 3.0
"""Distance between the outline that the pose puts and the one that was marked, beyond which it is said."""


def radiance_of(
    said: PhotographDocument, folder: Path, curve: str | Path | Curve, gain: float, *, align: bool, where: str
) -> HdrImage:
    """Radiance of a view: merged from its shots, or of its file.

    Raises
    ------
    InputError
        If it names neither, or both, or a file cannot be read.
    """
    if (said.file is None) == (not said.shots):
        raise InputError("names neither a file nor shots, or both", where=where, fix="give one of the two")
    if said.file is not None:
        image = linear_image(folder / said.file, curve)
    elif len({shot.exposure is None for shot in said.shots}) > 1:
        raise InputError("tells the exposure of some shots only", where=where, fix="give it for all, or for none")
    else:
        exposures = [shot.exposure.exposure() for shot in said.shots if shot.exposure is not None]
        files = [folder / shot.file for shot in said.shots]
        image = capture_hdr(files, curve=curve, exposures=exposures, align=align).image
    if gain == 1.0:
        return image
    return HdrImage(image.radiance / np.float32(gain), image.variance / np.float32(gain**2), image.saturated)


def posed(
    photograph: NamedPhotograph, image: HdrImage, sphere: SphereDocument | None, folder: Path
) -> tuple[BallPhotograph, str]:
    """Place the camera relative to the sphere, and say whether a marked outline disagrees.

    The sphere's centre and radius, where they are stated, place it. Otherwise its outline does, with the rotation of
    the pose: the scale of the poses does not matter.

    Raises
    ------
    InputError
        If the picture has another size than the camera, the camera is inside the sphere, or no outline is found.
    """
    camera, said = photograph.camera, photograph.said
    if image.size != (camera.width, camera.height):
        what = f"is {image.size[0]} × {image.size[1]} pixels, and its camera {camera.width} × {camera.height}"
        raise InputError(what, where=photograph.name, fix="give the intrinsics of the picture as it is")
    if sphere is None:
        cone = _cone(said, camera, image, folder, photograph.name)
        return BallPhotograph(image, replace(camera, position=-cone.axis * cone.distance), photograph.name), ""
    position = (camera.position - np.array(sphere.centre)) / sphere.radius
    if not np.linalg.norm(position) > 1:
        raise InputError("its camera is inside the sphere", where=photograph.name, fix="check sphere and pose")
    ball = BallPhotograph(image, replace(camera, position=position), photograph.name)
    if said.mask is None and said.circle is None and said.points is None:
        return ball, ""
    return ball, _disagreement(ball, _cone(said, camera, image, folder, photograph.name))


def _disagreement(ball: BallPhotograph, marked: Cone) -> str:
    put = Cone(-ball.view, ball.distance, 0.0).rim(ball.camera)
    seen = Cone(marked.axis, marked.distance, 0.0).rim(ball.camera)
    if not (np.isfinite(put).all() and np.isfinite(seen).all()):
        return f"{ball.name}: its pose puts the sphere out of the picture"
    middles = float(np.hypot(*(put.mean(axis=0) - seen.mean(axis=0))))
    sizes = abs(_radius(put) - _radius(seen))
    if max(middles, sizes) <= OFF_PIXELS:
        return ""
    return f"{ball.name}: its pose puts the sphere {max(middles, sizes):.1f} pixels from its outline"


def _radius(outline: NDArray[np.float64]) -> float:
    return float(np.hypot(*(outline - outline.mean(axis=0)).T).mean())


def _cone(said: PhotographDocument, camera: Pinhole, image: HdrImage, folder: Path, where: str) -> Cone:
    try:
        if said.points is not None:
            return fitted_cone(camera, np.array(said.points, dtype=np.float64).reshape(-1, 2))
        if said.circle is not None:
            return fitted_cone(camera, circle_places(*said.circle))
    except InputError as error:
        raise InputError(error.what, where=where, fix=error.fix) from None
    if said.mask is not None:
        mask = linear_image(folder / said.mask, "linear").radiance.mean(axis=2)
        if mask.shape != image.radiance.shape[:2]:
            raise InputError("has another size than its photograph", where=said.mask, fix="paint it anew")
        return fitted_cone(camera, mask_places(mask, said.mask))
    if said.silhouette == "found":
        return found_cone(camera, image.radiance, where)
    fix = 'state the sphere, or give mask, circle, points, or "silhouette": "found"'
    raise InputError("says nothing of where the sphere is", where=where, fix=fix)
