"""Config of a bake: scene, views, resolution, samples, effects. TOML, validated by pydantic.

Each error is one line that names the file, the dotted key, the value and the allowed values.
"""

from __future__ import annotations

import errno
import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    JsonValue,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from rsibr.errors import InputError
from rsibr.geometry.projections.faces import FACES
from rsibr.regular_file import read_regular
from rsibr.scene.auto import Auto, Between
from rsibr.scene.config_errors import describe
from rsibr.scene.overrides import apply_overrides, override_keys, path_start
from rsibr.scene.plugins_config import PluginsConfig


def _absolute_path(value: Any, info: ValidationInfo) -> Path:
    if isinstance(value, Path):
        return value
    if not isinstance(value, str) or not value:
        raise ValueError("should be the path of a file, as a string")
    try:
        path = (path_start(value, (info.context or {}).get("base", ".")) / Path(value).expanduser()).resolve()
        str(path).encode()  # the manifest of a bake is UTF-8 and names it
    except UnicodeEncodeError:
        raise ValueError("is no usable path: its name is not UTF-8") from None
    except (RuntimeError, OSError) as error:
        raise ValueError(f"is no usable path: {error}") from None
    return path


def _plugin(value: Any, info: ValidationInfo) -> dict[str, Any]:
    """Check that a table is a Mitsuba plugin, and make the paths under `filename` absolute."""
    return _plugin_table("", value, info)


def _plugin_table(name: str, value: Any, info: ValidationInfo) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError('should be a table with a type, as in {type = "diffuse"}')
    if not isinstance(value.get("type"), str) or not value["type"]:
        raise ValueError(f"{name}.type is missing" if name else "names no plugin: give it a type")
    return {key: _plugin_value(f"{name}.{key}" if name else key, item, info) for key, item in value.items()}


def _plugin_value(name: str, value: Any, info: ValidationInfo) -> Any:
    if name.rpartition(".")[2] == "filename" and not isinstance(value, str):
        raise ValueError(f"{name} should be a path, in quotes")
    if isinstance(value, Mapping):
        return _plugin_table(name, value, info)
    if isinstance(value, list):
        return [_plugin_value(name, item, info) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{name} = {value} should be finite")
    if not isinstance(value, bool | int | float | str):
        raise ValueError(f"{name} = {value} means nothing to Mitsuba")
    if name.rpartition(".")[2] == "filename":
        return str(_absolute_path(value, info))
    return str(value) if isinstance(value, str) else value


def _faces(value: Any, info: ValidationInfo) -> dict[str, Path]:
    """Paths of the six faces, from a table or from one path with `{face}` in it."""
    if isinstance(value, str):
        if "{face}" not in value:
            raise ValueError("should have {face} in it, which becomes px, nx, py, ny, pz, nz")
        value = {face: type(value)(value.replace("{face}", face)) for face in FACES}
    if not isinstance(value, Mapping):
        raise ValueError("should be a table of the paths px, nx, py, ny, pz, nz, or one path with {face} in it")
    unknown = [str(key) for key in value if key not in FACES]
    missing = [face for face in FACES if face not in value]
    if unknown or missing:
        what = f"no face is called {', '.join(unknown)}" if unknown else f"{', '.join(missing)} missing"
        raise ValueError(f"{what}: give px, nx, py, ny, pz, nz")
    return {face: _face(face, value[face], info) for face in FACES}


def _face(face: str, value: Any, info: ValidationInfo) -> Path:
    try:
        return _absolute_path(value, info)
    except ValueError as error:
        raise ValueError(f"{face} {error}") from None


NESTED_TOO_DEEPLY = "is nested too deeply"

FilePath = Annotated[Path, BeforeValidator(_absolute_path)]
"""Path, absolute once validated; relative paths start at the folder of the config, those of overrides where one is."""

FacePaths = Annotated[dict[str, Path], BeforeValidator(_faces)]
"""Path of each face of a cube, as `FilePath`."""

PluginTable = Annotated[dict[str, Any], BeforeValidator(_plugin)]
"""Mitsuba plugin as plain data: a `type`, and finite numbers, strings, booleans, lists and nested plugins."""

Finite = Annotated[float, Field(allow_inf_nan=False)]

DEFAULT_RESOLUTION = 256
"""Texels a side where nothing decides otherwise."""

DEFAULT_SAMPLES = 1024
"""Samples a texel where nothing decides otherwise."""

DEFAULT_SUBDIVISION = 0
"""Subdivisions of the icosahedron where nothing decides otherwise."""


class _Section(BaseModel):
    # Strict: TOML is typed, so that `true` or `1.5` in place of an integer is an error
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    def _require_exactly_one(self, *names: str) -> None:
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give exactly one of {', '.join(names)} (given: {', '.join(given) or 'none'})")


class EnvironmentConfig(_Section):
    """Distant environment: exactly one of `file`, `faces` and `emitter`.

    Attributes
    ----------
    file : Path, optional
        OpenEXR or Radiance HDR.
    faces : dict of str to Path, optional
        Files of the faces px, nx, py, ny, pz, nz of a cube; or one path with `{face}` in place of these.
    projection : str, optional
        Projection of `file` or `faces` (`rsibr.geometry.projections.projection.projection_names`); by default what the
        header of the file states, or else "latlong", Mitsuba's; of faces, "cube".
    emitter : dict, optional
        Mitsuba emitter at infinity, as plain data.
    layer : str, optional
        Layer, part or view of OpenEXR files that hold several pictures.
    rotation_deg : float
        Rotation about +Y [°], counter-clockwise seen from above.
    scale : float
        Factor on the radiance, > 0.
    """

    file: FilePath | None = None
    faces: FacePaths | None = None
    emitter: PluginTable | None = None
    projection: str | None = None
    layer: str | None = None
    rotation_deg: Finite = 0.0
    scale: Finite = Field(default=1.0, gt=0.0)

    @model_validator(mode="after")
    def _one_source(self) -> EnvironmentConfig:
        self._require_exactly_one("file", "faces", "emitter")
        if self.layer is not None and self.emitter is not None:
            raise ValueError("layer chooses a picture of a file: give file in place of emitter")
        if self.projection is not None and self.emitter is not None:
            raise ValueError("projection is that of a file: give file or faces in place of emitter")
        return self


class MaterialConfig(_Section):
    """Material: exactly one of `preset`, `bsdf` and `file`.

    Attributes
    ----------
    preset : str, optional
        Name of a material shipped with rsibr (`rsibr.scene.presets.PRESETS`).
    bsdf : dict, optional
        Mitsuba BSDF as plain data.
    file : Path, optional
        Mitsuba XML: a BSDF, or a scene that contains exactly one.
    warp : {"auto", "mirror", "normal"}
        Direction by which a map is indexed when it is warped as one lobe: the mirror direction or the surface normal.
        `auto` selects the normal for a purely diffuse material.
    """

    preset: str | None = None
    bsdf: PluginTable | None = None
    file: FilePath | None = None
    warp: Literal["auto", "mirror", "normal"] = "auto"

    @model_validator(mode="after")
    def _one_source(self) -> MaterialConfig:
        self._require_exactly_one("preset", "bsdf", "file")
        return self


class ViewsConfig(_Section):
    """Stored views: the vertices of a subdivided icosahedron, or given directions.

    Attributes
    ----------
    subdivision : int or "auto"
        0 to 5: 12, 42, 162, 642, 2562, 10242 views. "auto": as a budget decides, otherwise `DEFAULT_SUBDIVISION`.
    file : Path, optional
        JSON with `directions` (N, 3) and `triangles` (M, 3), instead of an icosahedron.
    """

    subdivision: Annotated[int | Auto, Between(0, 5)] = "auto"
    file: FilePath | None = None

    @property
    def level(self) -> int:
        """Subdivisions of the icosahedron; the default where they are left open."""
        return DEFAULT_SUBDIVISION if self.subdivision == "auto" else self.subdivision

    @property
    def is_open(self) -> bool:
        """Whether the config leaves it to a budget which views are stored."""
        return self.file is None and self.subdivision == "auto"

    @model_validator(mode="after")
    def _one_source(self) -> ViewsConfig:
        if self.file is not None and self.subdivision not in ("auto", 0):  # 0: in manifests older than "auto"
            raise ValueError("give either subdivision or file, not both")
        return self


class MapConfig(_Section):
    """The sphere maps.

    Attributes
    ----------
    resolution : int or "auto"
        Texels a side, 8 to 4096. "auto": as a budget decides, otherwise `DEFAULT_RESOLUTION`, lowered where the
        evidence says that fewer texels hold all that the light casts.
    """

    resolution: Annotated[int | Auto, Between(8, 4096)] = "auto"

    @property
    def side(self) -> int:
        """Texels a side; the default where they are left open."""
        return DEFAULT_RESOLUTION if self.resolution == "auto" else self.resolution


class SamplingConfig(_Section):
    """Samples: their number, or one of `target_error` and `time_budget_s` from which it follows.

    Attributes
    ----------
    samples : int or "auto"
        Samples a texel, 4 to 2^24; on average, where they are adaptive. "auto": as a budget, an error or a time
        decides, otherwise `DEFAULT_SAMPLES`.
    target_error : float, optional
        Largest noise of the stored maps, as relMSE, mean over the views.
    time_budget_s : float, optional
        Duration of the whole bake [s].
    adaptive : bool
        Whether noisier texels and views get more samples, if a pilot predicts a gain.
    seed : int
        Root seed of all random numbers.
    clamp : float, optional
        Radiance above which a single sample is clamped: fewer fireflies, but biased, darker maps. By default none.
    """

    samples: Annotated[int | Auto, Between(4, 2**24)] = "auto"
    target_error: Finite | None = Field(default=None, gt=0.0)
    time_budget_s: Finite | None = Field(default=None, gt=0.0)
    adaptive: bool = True
    seed: int = Field(default=0, ge=0, lt=2**63)
    clamp: Finite | None = Field(default=None, gt=0.0)

    @property
    def count(self) -> int:
        """Samples a texel; the default where they are left open."""
        return DEFAULT_SAMPLES if self.samples == "auto" else self.samples

    @property
    def decided_later(self) -> bool:
        """Whether the number of samples follows from an error or a duration."""
        return self.target_error is not None or self.time_budget_s is not None

    @model_validator(mode="after")
    def _one_count(self) -> SamplingConfig:
        counts = {name: getattr(self, name) for name in ("samples", "target_error", "time_budget_s")}
        given = [name for name, value in counts.items() if value not in (None, "auto")]
        if len(given) > 1:
            raise ValueError(f"give one of {' and '.join(given)}, not {'all' if len(given) > 2 else 'both'}")
        return self


class BudgetConfig(_Section):
    """Budget of the whole bake: exactly one of `error` and `seconds`.

    It decides on what the config leaves at "auto" of `map.resolution`, `views.subdivision` and `sampling.samples`.

    Attributes
    ----------
    error : float, optional
        Largest relMSE of a novel view by the method `rsibr` against the path-traced reference.
    seconds : float, optional
        Longest duration of the whole bake [s].
    """

    error: Finite | None = Field(default=None, gt=0.0)
    seconds: Finite | None = Field(default=None, gt=0.0)

    @model_validator(mode="after")
    def _one_limit(self) -> BudgetConfig:
        self._require_exactly_one("error", "seconds")
        return self


Switch = Literal["auto", "on", "off"]
"""Whether an effect is simulated: by evidence ("auto"), or forced."""


class EffectsConfig(_Section):
    """Effects, each decided by evidence ("auto") or forced; `rsibr plan` prints the evidence.

    Attributes
    ----------
    lobes : {"auto", "off"}
        Whether a layer is stored for each lobe of the material. The method `rsibr` needs them.
    diffuse, glossy, clear_coat, mirror : Switch
        Lobes of the material. A lobe that is forced off is missing from the maps.
    view_dependence : Switch
        Maps from several views. Off: light without a closed form is missing between the views.
    fresnel : Switch
        Whether the albedo of each lobe follows the surface's view angle in a reconstruction.
    colour : Switch
        Three channels; off: the red channel is used for all.
    light_sampling : Switch
        Whether the emitter is sampled besides the BSDF, which a sun requires.
    lobe_views : Switch
        Whether every view stores a layer for each lobe. `auto`: a lobe has a layer in the first views of an icosphere,
        as many as it needs; in the other views such lobes share one layer. Off: no lobe has a layer of its own in more
        than the next smaller number of views, at least 12.
    resolution : Switch
        Whether maps keep all their texels; off: as few a side as the evidence allows, at most half of what was asked
        and no fewer than 32. `auto` lowers them only where `map.resolution` is "auto" too.
    spectral : Switch
        Light and material rendered at sampled wavelengths; maps hold linear RGB.
    polarisation : Switch
        Light and material rendered with Mueller matrices, spectrally, because Mitsuba has no polarised RGB variant;
        maps hold the intensity.
    """

    lobes: Literal["auto", "off"] = "auto"
    view_dependence: Switch = "auto"
    diffuse: Switch = "auto"
    glossy: Switch = "auto"
    clear_coat: Switch = "auto"
    mirror: Switch = "auto"
    fresnel: Switch = "auto"
    colour: Switch = "auto"
    light_sampling: Switch = "auto"
    lobe_views: Switch = "auto"
    resolution: Switch = "auto"
    spectral: Switch = "auto"
    polarisation: Switch = "auto"

    @model_validator(mode="after")
    def _polarised_in_spectra(self) -> EffectsConfig:
        if self.polarisation == "on" and self.spectral == "off":
            raise ValueError('polarisation is rendered in spectra only: leave spectral at "auto"')
        return self

    @model_validator(mode="after")
    def _left_out_apart(self) -> EffectsConfig:
        off = [name for name in ("diffuse", "glossy", "clear_coat", "mirror") if getattr(self, name) == "off"]
        if off and self.lobes == "off":
            raise ValueError(f"{', '.join(off)} can be left out only where lobes are kept apart: leave lobes at 'auto'")
        return self


CHECKED_TOGETHER = (("sampling", "budget"),)
"""Sections whose validity depends on each other; a validator of `Config` that reads two sections has an entry here."""


class Config(_Section):
    """All settings of a bake. Made by `load_config` or `parse_config`.

    `methods` holds options of reconstruction methods, in a table for each method. They do not change what is baked.
    """

    environment: EnvironmentConfig
    material: MaterialConfig
    views: ViewsConfig = ViewsConfig()
    map: MapConfig = MapConfig()
    sampling: SamplingConfig = SamplingConfig()
    effects: EffectsConfig = EffectsConfig()
    budget: BudgetConfig | None = None
    plugins: PluginsConfig | None = None
    methods: dict[str, dict[str, JsonValue]] | None = None

    @property
    def plugin_modules(self) -> tuple[str, ...]:
        """Modules that register Mitsuba plugins, see `PluginsConfig`."""
        return () if self.plugins is None else self.plugins.modules

    @model_validator(mode="after")
    def _finite_options(self) -> Config:
        for method, options in (self.methods or {}).items():
            for option, value in options.items():
                numbers = value if isinstance(value, list) else [value]
                if any(isinstance(one, float) and not math.isfinite(one) for one in numbers):
                    raise ValueError(f"methods.{method}.{option} is not finite: write it as text, in quotes")
        return self

    @model_validator(mode="after")
    def _one_budget(self) -> Config:
        if self.budget is not None and self.sampling.decided_later:
            raise ValueError("[budget] decides on the samples: leave out sampling.target_error and time_budget_s")
        return self

    def with_plugins(self, modules: Sequence[str]) -> Config:
        """Return the config with these modules after its own; see `PluginsConfig`."""
        names = dict.fromkeys([*self.plugin_modules, *modules])
        return self.model_copy(update={"plugins": PluginsConfig(modules=tuple(names))}) if names else self

    def to_dict(self) -> dict[str, Any]:
        """Return the config as plain JSON data, paths as strings; `parse_config` reads it back to an equal config."""
        return self.model_dump(mode="json", exclude_none=True)


ConfigLike = Config | Mapping[str, Any] | Path | str
"""What the public functions take for a config: one already read, its tables, or the path of a TOML file."""


def config_of(config: ConfigLike, overrides: Sequence[str] = ()) -> Config:
    """Return the config itself, or read and check it.

    Parameters
    ----------
    config : Config, mapping or path
        A config, its tables (relative paths then start at the working folder), or the path of a TOML file.
    overrides : sequence of str
        `a.b=value`, laid over it.

    Raises
    ------
    InputError
        See `load_config`.
    """
    if isinstance(config, Config):
        return parse_config(config.to_dict(), Path(), overrides) if overrides else config
    return parse_config(config, Path(), overrides) if isinstance(config, Mapping) else load_config(config, overrides)


def load_config(path: Path | str, overrides: Sequence[str] = ()) -> Config:
    """Read a config from a TOML file.

    Parameters
    ----------
    path : Path
        The file. Relative paths in it start at its folder, those in the overrides at the working folder.
    overrides : sequence of str
        `a.b=value`, applied to the file; see `rsibr.scene.overrides.apply_overrides`.

    Raises
    ------
    InputError
        If the file cannot be read, is not UTF-8 or not TOML, or has an invalid key or value; all of these are named at
        once. Files named in the config are checked when they are loaded.
    """
    path = Path(path)
    return parse_config(read_toml(path), path.resolve().parent, overrides, where=str(path))


def parse_config(
    data: Mapping[str, Any], base: Path, overrides: Sequence[str] = (), *, where: str = "config"
) -> Config:
    """Validate a config given as a mapping; see `load_config`.

    Parameters
    ----------
    data : mapping
        The tables of the config.
    base : Path
        Folder at which relative paths in `data` start.
    overrides : sequence of str
        `a.b=value`, applied to `data`.
    where : str
        Origin that an error names.
    """
    try:
        merged = apply_overrides(data, overrides)
        return Config.model_validate(merged, context={"base": Path(base).resolve()})
    except RecursionError:
        raise InputError(NESTED_TOO_DEEPLY, where=where) from None
    except ValidationError as error:
        problems = describe(error, Config, override_keys(overrides))
        raise InputError("; ".join(problems), where=where) from None


def read_toml(path: Path) -> dict[str, Any]:
    """Read the tables of a TOML file; InputError if it cannot be read."""
    try:
        text = read_regular(path).decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError("there is no such config", where=str(path), fix="check the path") from None
    except OSError as error:
        if error.errno == errno.EISDIR:
            raise InputError("is a folder, not a config", where=str(path), fix="name a TOML file in it") from None
        raise InputError(f"cannot be read: {error.strerror}", where=str(path)) from None
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 (byte {error.start})", where=str(path), fix="save the file as UTF-8") from None
    except ValueError as error:
        raise InputError(f"cannot be read: {error}", where=str(path)) from None
    try:
        return tomllib.loads(text)
    except ValueError as error:  # also raised for integers of thousands of digits
        raise InputError(f"is not valid TOML: {error}", where=str(path)) from None
    except RecursionError:
        raise InputError(NESTED_TOO_DEEPLY, where=str(path)) from None
