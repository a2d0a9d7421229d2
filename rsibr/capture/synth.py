"""`rsibr capture synth`: photographs of a ball under a known sky, to try a capture out, and to test it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rsibr import backend
from rsibr.capture.balls.ball_photograph import FARTHEST
from rsibr.capture.cameras.pinhole import Pinhole
from rsibr.capture.curves.chosen import chosen_curve
from rsibr.capture.direction import unit
from rsibr.capture.synthetic.brackets import bracketed
from rsibr.capture.synthetic.camera_file import write_photograph
from rsibr.capture.synthetic.rendering import rendered
from rsibr.capture.synthetic.scenes import ball_under
from rsibr.capture.synthetic.sensor import Sensor
from rsibr.errors import InputError
from rsibr.scene.environment import Environment
from rsibr.store.atomic import write_atomic
from rsibr.store.directory import make_folder

CAPTURE_NAME = "capture.json"
_MIDDLE = 0.18
"""Share of saturation that the median pixel of the ball reaches in the middle shot: a photographer's grey card."""

_MARGIN = 1.15  # of the field of view about the ball


@dataclass(frozen=True)
class Shooting:
    """How a ball is photographed.

    Attributes
    ----------
    distance : float
        From the camera to the centre of the ball, in its radii; above 1, up to 10 000.
    pixels : int
        Along a side of a photograph.
    shots : int
        Exposures of each view.
    stops : float
        Between them.
    bits : int
        8 or 16.
    curve : str
        Name or file of the camera's curve.
    samples : int
        Rays a pixel.
    seed : int
        Of rays and noise.
    """

    distance: float = 10.0
    pixels: int = 512
    shots: int = 8
    stops: float = 2.0
    bits: int = 8
    curve: str = "srgb"
    samples: int = 64
    seed: int = 0

    def __post_init__(self) -> None:
        checks = (
            ("distance", 1 < self.distance <= FARTHEST, f"give more than 1 radius, up to {FARTHEST:g}"),
            ("pixels", 8 <= self.pixels <= 8192, "give 8 to 8192"),
            ("shots", 1 <= self.shots <= 64, "give 1 to 64"),
            ("stops", 0 < self.stops <= 8, "give more than 0, up to 8"),
            ("bits", self.bits in (8, 16), "give 8 or 16"),
            ("samples", 1 <= self.samples <= 4096, "give 1 to 4096"),
            ("seed", 0 <= self.seed < 2**31, "give 0 to 2147483647"),
        )
        for name, is_right, fix in checks:
            if not is_right:
                raise InputError(f"{name} is {getattr(self, name)}", where=name, fix=fix)


@backend.in_session
def capture_synth(
    environment: Environment,
    bsdf: mi.BSDF | dict[str, Any],
    views: Sequence[ArrayLike],
    out: Path | str,
    shooting: Shooting | None = None,
) -> Path:
    """Photograph a ball under an environment, and write what a photographer would bring home.

    Parameters
    ----------
    environment : Environment
        Light from infinity.
    bsdf : mi.BSDF or dict
        Of the ball.
    views : sequence of array_like, shape (3,)
        Directions from the ball to the camera.
    out : path
        Folder; made if it does not exist.
    shooting : Shooting, optional
        Camera.

    Returns
    -------
    Path
        `capture.json`: intrinsics, poses (OpenCV's camera to world), masks, the files of each view with their
        exposures, and the `gain` by which merged photographs exceed the radiance of the scene. The photographs lie
        beside it.

    Raises
    ------
    InputError
        If there is no view, the environment is black on the ball, or the folder holds photographs that would not be
        replaced.
    """
    camera_like, folder = shooting or Shooting(), Path(out)
    if not len(views):
        raise InputError("no views", where="view", fix="give at least one direction, X,Y,Z")
    _check_folder(folder, len(views), camera_like.shots)
    make_folder(folder)
    things = ball_under(environment, bsdf)
    pictures = [_picture(things, view, index, camera_like) for index, view in enumerate(views)]
    gain = _gain(pictures, camera_like, environment.name)
    photographs = [_written(picture, index, folder, gain, camera_like) for index, picture in enumerate(pictures)]
    document = {"schema": 1, "convention": "opencv", "sphere": {"centre": [0, 0, 0], "radius": 1}, "gain": gain}
    path = folder / CAPTURE_NAME
    write_atomic(path, json.dumps({**document, "photographs": photographs}, indent=1).encode())
    return path


def _check_folder(folder: Path, views: int, shots: int) -> None:
    """Raise an InputError where a photograph of an earlier run would lie among those of this one."""
    made = {_shot_name(view, shot) for view in range(views) for shot in range(shots)}
    found = folder.glob("view_*_shot_*.png") if folder.is_dir() else ()
    left = sorted(file.name for file in found if file.name not in made)
    if left:
        what = f"holds {left[0]} of an earlier run, which this one would not replace"
        raise InputError(what, where=str(folder), fix="choose another folder, or empty it")


def _shot_name(view: int, shot: int) -> str:
    return f"view_{view:02d}_shot_{shot}.png"


@dataclass(frozen=True, eq=False)
class _Picture:
    """What a camera sees, before its sensor."""

    camera: Pinhole
    radiance: NDArray[np.float32]
    alpha: NDArray[np.float32]


def _picture(things: dict[str, Any], view: ArrayLike, index: int, shooting: Shooting) -> _Picture:
    camera = _camera(view, shooting)
    return _Picture(camera, *rendered(things, camera, samples=shooting.samples, seed=shooting.seed + index))


def _gain(pictures: Sequence[_Picture], shooting: Shooting, name: str) -> float:
    """Sensitivity of the camera, one for all views, at which the middle shot shows the ball well."""
    middle = float(np.median(np.concatenate([one.radiance[one.alpha > 0.5] for one in pictures])))
    if not middle > 0:
        raise InputError("no light falls on the ball", where=name, fix="use another environment")
    return _MIDDLE / middle * 2 ** (shooting.stops * (shooting.shots - 1) / 2)


def _written(picture: _Picture, index: int, folder: Path, gain: float, shooting: Shooting) -> dict[str, Any]:
    """Write the shots of a view; return what `capture.json` says of it."""
    mask, covered = f"view_{index:02d}_mask.png", np.rint(picture.alpha * 255).astype(np.uint8)
    write_photograph(folder / mask, np.repeat(covered[..., None], 3, axis=2))
    sensor, seed = Sensor(chosen_curve(shooting.curve), shooting.bits), shooting.seed * 1000 + index
    shots = []
    brackets = bracketed(picture.radiance, sensor, shots=shooting.shots, stops=shooting.stops, gain=gain, seed=seed)
    for number, shot in enumerate(brackets):
        name = _shot_name(index, number)
        steps: NDArray[np.float32] = np.rint(shot.values * shot.levels)
        integers = steps.astype(np.uint8) if shot.levels == 255 else steps.astype(np.uint16)
        write_photograph(folder / name, integers, shot.exposure)
        shots.append({"file": name, "exposure": shot.exposure.to_record() if shot.exposure else None})
    return {**_record(picture.camera), "mask": mask, "shots": shots}


def _camera(view: ArrayLike, shooting: Shooting) -> Pinhole:
    field = 2 * _MARGIN * float(np.degrees(np.arcsin(1 / shooting.distance)))
    position = unit(view, "view") * shooting.distance
    return Pinhole.looking(
        position, (0, 0, 0), fov_deg=min(field, 150.0), width=shooting.pixels, height=shooting.pixels
    )


def _record(camera: Pinhole) -> dict[str, Any]:
    matrix: NDArray[np.float64] = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = camera.axes, camera.position
    return {
        "width": camera.width,
        "height": camera.height,
        "intrinsics": [*camera.focal.tolist(), *camera.principal.tolist()],
        "pose": matrix.tolist(),
    }
