"""Distant environment: a map in any projection or any Mitsuba emitter at infinity, rotated and scaled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.latlong import LatLong, read_faces, read_latlong
from rsibr.scene.orientation import rotated, turned
from rsibr.scene.plugin import (
    canonical_json,
    content_digest,
    mitsuba_errors,
    named_files,
    named_types,
    require_files,
)
from rsibr.scene.python_plugins import sources_of
from rsibr.scene.spectra import in_every_variant
from rsibr.scene.trial import require_survival, warn_untried

_WHERE = "environment.emitter"
_FIX = "see the emitters in Mitsuba's plugin reference"

RADIANCE_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "constant": ("radiance",),
    "directional": ("irradiance",),
    "sunsky": ("sun_scale", "sky_scale"),
    "timed_sunsky": ("sun_scale", "sky_scale"),
}
"""Parameters that the radiance of each emitter type is proportional to, for emitters that are not maps; default 1."""

BRIGHTEST_SUM = 1e38
"""Sum of an image's values above which Mitsuba's float32 sampling table of an envmap overflows."""

_ROTATION = 1e-6
"""Tolerance within which a matrix counts as orthogonal."""

FAINTEST_SUM = 1e-30
"""Sum below which the sampling table cannot be normalised: the density of a black envmap is NaN."""


@dataclass(frozen=True, eq=False)
class Environment:
    """Validated distant environment. Made by `load_environment`.

    Attributes
    ----------
    name : str
        Stem of the file, or the emitter's type.
    digest : str
        SHA-256 of the content with its rotation and scale, independent of file names.
    image : ndarray (H, W, 3), float32, or None
        Radiance of a map [W sr⁻¹ m⁻²], scaled, negative values clipped; None for other emitters.
    clipped : int
        Number of negative values that were clipped.
    lowest : float
        Lowest of these values; 0 if there was none.
    plugin : dict
        Mitsuba emitter as plain data, rotated, without the image.
    notes : tuple of str
        What was converted, cut off or left aside when a map was read, and what looks odd.
    """

    name: str
    digest: str
    image: NDArray[np.float32] | None
    clipped: int
    lowest: float
    plugin: dict[str, Any] = field(repr=False)
    notes: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        """Columns of the map; 0 for other emitters."""
        return 0 if self.image is None else self.image.shape[1]

    @property
    def frame(self) -> NDArray[np.float64] | None:
        """Axes of the map in world coordinates, shape (3, 3); None if `to_world` is not orthogonal."""
        turn = np.array(self.plugin.get("to_world", np.eye(4)), dtype=np.float64)[:3, :3]
        return turn if np.allclose(turn @ turn.T, np.eye(3), rtol=0.0, atol=_ROTATION) else None

    @property
    def is_black(self) -> bool:
        """Whether it is a map without any light."""
        return self.image is not None and not self.image.any()

    def emitter(self) -> dict[str, Any]:
        """Return the emitter as a dict for `mi.load_dict`.

        A black image becomes a `constant` emitter of radiance 0: Mitsuba's density of a black envmap is NaN.
        """
        if self.is_black:
            return {"type": "constant", "radiance": 0.0}
        emitter = dict(self.plugin)
        if "to_world" in emitter:
            emitter["to_world"] = mi.ScalarTransform4f(np.array(emitter["to_world"], dtype=np.float64))
        if self.image is not None:
            emitter["bitmap"] = mi.Bitmap(self.image)
        return emitter


def load_environment(config: EnvironmentConfig) -> Environment:
    """Read and validate an environment.

    Parameters
    ----------
    config : EnvironmentConfig
        A file, six faces, or a Mitsuba emitter; rotation about +Y [°] and scale.

    Raises
    ------
    InputError
        If the file cannot be used (see `rsibr.scene.latlong.read_latlong`), Mitsuba rejects the emitter, or the emitter
        is not at infinity, cannot be scaled, or has radiance that is negative or not finite.

    Notes
    -----
    An emitter of type `envmap` is read and validated like a file. Mitsuba places the rows of an envmap at
    v = j/(H−1), so that the first and the last lie on the poles, and its columns at u = (i+½)/W.
    """
    backend.use()
    untried = require_survival(config, _WHERE) if config.emitter is not None else ""
    environment = _read(config)
    _check_emitter(environment, _source(config))
    warn_untried(untried)
    return environment


def environment_digest(config: EnvironmentConfig) -> str:
    """Digest of the content as `load_environment` finds it; files are read, and Mitsuba loads nothing.

    Raises
    ------
    InputError
        If a file is gone or cannot be used.
    """
    return _read(config).digest


def _source(config: EnvironmentConfig) -> str:
    """What an error names."""
    if config.faces is not None:
        return "environment.faces"
    return str(config.file) if config.file else _WHERE


def _read(config: EnvironmentConfig) -> Environment:
    plugin = in_every_variant(rotated(config.emitter or {"type": "envmap"}, config.rotation_deg, _WHERE), _WHERE)
    name = _name(config)
    if plugin["type"] != "envmap":
        return _plain(name, plugin, config.scale)
    scale = config.scale
    if config.emitter is not None:
        config, scale = _of_envmap(plugin, config)
    if config.faces is not None:
        latlong = read_faces(
            config.faces, layer=config.layer, projection="cube" if config.projection is None else config.projection
        )
    else:
        assert config.file is not None
        latlong = read_latlong(config.file, layer=config.layer, projection=config.projection)
    return _map(name, plugin, scale, latlong, _source(config))


def _name(config: EnvironmentConfig) -> str:
    """Stem of the file, what the stems of the faces begin with or their folder, or the emitter's type."""
    if config.emitter is not None:
        return str(config.emitter["type"])
    if config.file is not None:
        return config.file.stem
    paths = list((config.faces or {}).values())
    places = zip(*(path.stem for path in paths), strict=False)
    common = "".join(letters[0] for letters in takewhile(lambda letters: len(set(letters)) == 1, places))
    return common.rstrip("_-. ") or paths[0].parent.name or "cube"


def _of_envmap(plugin: dict[str, Any], config: EnvironmentConfig) -> tuple[EnvironmentConfig, float]:
    """Take the file and the scale out of an emitter of type envmap."""
    if "filename" not in plugin:
        raise InputError("an envmap needs the key filename", where=_WHERE, fix="or give environment.file")
    path = Path(plugin.pop("filename"))
    own_scale = plugin.pop("scale", 1.0)
    if isinstance(own_scale, bool) or not isinstance(own_scale, int | float) or own_scale <= 0.0:
        raise InputError(f"scale = {own_scale} should be a positive number", where=_WHERE)
    return EnvironmentConfig(file=path), config.scale * own_scale


def _map(name: str, plugin: dict[str, Any], scale: float, latlong: LatLong, where: str) -> Environment:
    image = _usable(latlong, scale, where)
    if latlong.turn:
        plugin["to_world"] = turned(plugin.get("to_world"), latlong.turn)
    shape = "x".join(map(str, image.shape))
    content, described = image, f"{canonical_json(plugin)} {shape}"
    if latlong.sheets is not None:
        content, described = latlong.sheets, f"{described} {latlong.projection} {latlong.sheets.shape} {scale!r}"
    digest = content_digest(described, data=content.astype("<f4").tobytes())
    return Environment(name, digest, image, latlong.clipped, latlong.lowest, plugin, latlong.notes)


def _usable(latlong: LatLong, scale: float, where: str) -> NDArray[np.float32]:
    """Scale the image, and reject values that Mitsuba's sampling table cannot represent."""
    with np.errstate(over="ignore", under="ignore"):
        image: NDArray[np.float32] = latlong.image * np.float32(scale)
    total = float(image.sum(dtype=np.float64))
    if not total < BRIGHTEST_SUM:
        raise InputError(
            f"its values sum up to {total:.3g}, more than {BRIGHTEST_SUM:.0e}", where=where, fix="lower the scale"
        )
    if total < FAINTEST_SUM:
        return np.zeros_like(image)
    if len(image) > 1 and float(image[1:].sum(dtype=np.float64)) < FAINTEST_SUM:
        raise InputError(
            "only its first row has light: it lies on the pole, where Mitsuba cannot sample it",
            where=where,
            fix="use a map with more rows",
        )
    return image


def _plain(name: str, plugin: dict[str, Any], scale: float) -> Environment:
    require_files(plugin, _WHERE)
    plugin = plugin if scale == 1.0 else _scaled(plugin, scale)
    digest = content_digest(canonical_json(plugin), [*named_files(plugin), *sources_of(named_types(plugin))])
    return Environment(name, digest, None, 0, 0.0, plugin)


def _scaled(plugin: dict[str, Any], scale: float) -> dict[str, Any]:
    parameters = RADIANCE_PARAMETERS.get(plugin["type"])
    if parameters is None:
        raise InputError(
            f"'{plugin['type']}' is no emitter at infinity that can be scaled",
            where="environment.scale",
            fix=f"use envmap, {', '.join(RADIANCE_PARAMETERS)}, or leave the scale at 1",
        )
    return {**plugin, **{name: _product(plugin.get(name, 1.0), scale, name) for name in parameters}}


def _product(value: Any, scale: float, name: str) -> Any:
    if isinstance(value, Mapping) and value["type"] == "rgb" and "value" in value:
        return {**value, "value": _product(value["value"], scale, name)}
    if isinstance(value, list):
        return [_product(item, scale, name) for item in value]
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value * scale
    raise InputError(
        f"{name} is neither a number nor an rgb colour", where="environment.scale", fix=f"scale {name} itself"
    )


def _check_emitter(environment: Environment, where: str) -> None:
    """Load the emitter and evaluate it in directions all around."""
    with mitsuba_errors(where, _FIX):
        scene = backend.load({"type": "scene", "emitter": environment.emitter()})
    emitters = scene.emitters()
    if len(emitters) != 1 or not mi.has_flag(emitters[0].flags(), mi.EmitterFlags.Infinite):
        raise InputError(
            f"{environment.name} is no emitter at infinity",
            where=where,
            fix=f"use envmap, {', '.join(RADIANCE_PARAMETERS)}",
        )
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = -mi.warp.square_to_uniform_sphere(mi.Point2f(*dr.meshgrid(*[dr.linspace(mi.Float, 0.01, 0.99, 32)] * 2)))
    radiance = np.array(emitters[0].eval(si))
    if not (np.isfinite(radiance).all() and (radiance >= 0.0).all()):
        raise InputError("sends radiance that is negative or not finite", where=where, fix=_FIX)
    _check_sampling(scene, environment.name, where)


def _check_sampling(scene: mi.Scene, name: str, where: str) -> None:
    """Draw from the emitter; in Mitsuba 3.9 `timed_sunsky` loads and can be evaluated, but not be drawn from."""
    try:
        dr.eval(
            scene.sample_emitter_direction(dr.zeros(mi.Interaction3f, 2), mi.Point2f([0.3, 0.6], [0.2, 0.7]), False)
        )
    except RuntimeError as error:
        raise InputError(
            f"Mitsuba cannot draw directions from '{name}' in the variant {mi.variant()}, nor render under it",
            where=where,
            fix="use a sunsky with a sun_direction, or an envmap",
        ) from error
