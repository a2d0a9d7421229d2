"""Manifest of a bake: config, versions, and the state of each view.

`manifest.json` is authoritative: a map that it does not list as done is ignored, even if its file exists.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from rsibr.errors import BakeError, printable
from rsibr.geometry.viewpoints import VIEW_COUNTS
from rsibr.planning.plan import Plan
from rsibr.store.atomic import checksum, read_bytes, write_atomic

MANIFEST_NAME = "manifest.json"
MAPS_NAME = "maps"
LIGHT_NAME = "light.exr"
LIGHTS_NAME = "lights"
SCHEMA_VERSION: Literal[1] = 1

MAX_RESOLUTION = 4096
"""Largest number of texels along a side of a map."""

LARGEST_MANIFEST = 2**28
"""Largest size of a manifest that is read [bytes]; one of 10 242 views has 8 MB."""

_SHA256 = r"^[0-9a-f]{64}$"
_VARIANT = r"^(scalar|llvm_ad|cuda_ad)_(rgb|spectral|spectral_polarized)$"
_LAYER = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"
_SHARED_LIGHT = re.compile(rf"(?:\.\./)+{LIGHTS_NAME}/([0-9a-f]{{64}})\.exr")
_LONGEST_PLACE = 100

Vector = tuple[float, float, float]
Triangle = tuple[int, int, int]
Seconds = Annotated[float, Field(ge=0.0, le=1e10)]
"""Time [s]. Its bound keeps sums over all views finite."""

Size = Annotated[int, Field(ge=0, le=2**53)]
"""Size [bytes], or another count; its bound keeps it exact in any reader of JSON."""

LayerName = Annotated[str, Field(pattern=_LAYER)]
"""Name of a layer; it becomes a part of file names, so that it must not hold a path."""


class Record(BaseModel):
    """Part of a file of a bake: immutable, numbers finite, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class EnvironmentRecord(Record):
    """Environment: its name, the number of negative values clipped, and the lowest of them."""

    name: str
    clipped: Size = 0
    lowest: float = 0.0


class MaterialRecord(Record):
    """Material: its name, the warp for one lobe, and notes on what maps cannot represent."""

    name: str
    warp: Literal["mirror", "normal"]
    notes: tuple[str, ...] = ()


class ProxyRecord(Record):
    """One roughness of the proxy of a lobe; see `rsibr.lobes.fit.ProxyLobe`.

    Attributes
    ----------
    alpha : float
        Roughness α.
    coefficients : tuple of colours
        Coefficients of its basis functions.
    """

    alpha: float
    coefficients: tuple[Vector, ...]


class GaussianRecord(Record):
    """One Gaussian over microfacet slopes; see `rsibr.lobes.gaussians.Gaussians`.

    Attributes
    ----------
    sigma : float
        Standard deviation of the slopes.
    plain, grazing : colour
        Its weights without a Fresnel term, and times Schlick's.
    """

    sigma: float
    plain: Vector
    grazing: Vector


class ShapeRecord(Record):
    """Shape of a lobe; see `rsibr.lobes.gaussians.LobeShape`.

    Attributes
    ----------
    alpha : float
        Roughness α in the masking.
    bare, coated : tuple of GaussianRecord
        Microfacets on the surface and under a coat.
    matte : (colour, colour)
        Weights of a cosine lobe, bare and coated.
    """

    alpha: float
    bare: tuple[GaussianRecord, ...]
    coated: tuple[GaussianRecord, ...]
    matte: tuple[Vector, Vector]


class LobeRecord(Record):
    """One lobe of the material.

    Attributes
    ----------
    name : str
        Name of the layer.
    alpha : float
        Roughness α of the lobe; see `rsibr.lobes.split.Lobe`.
    albedo : tuple of colours
        Directional albedo by view angle; see `rsibr.lobes.albedo`.
    proxies : tuple of ProxyRecord
        Proxy of the lobe; empty for a delta lobe, and in bakes older than this record.
    shape : ShapeRecord or None
        The lobe's own shape, which predictions use; None for a delta lobe, and in bakes older than this record.
    views : int or None
        Number of views that store it as a layer of its own, the first ones; the others store it added to further lobes.
        None if all views do, and in bakes older than this field. See `rsibr.store.layers`.
    """

    name: LayerName
    alpha: float
    albedo: tuple[Vector, ...]
    proxies: tuple[ProxyRecord, ...] = ()
    shape: ShapeRecord | None = None
    views: int | None = Field(None, ge=1)


class LightRecord(Record):
    """File of the environment.

    Attributes
    ----------
    sha256 : str
        Checksum of the file.
    bytes : int
        Its size [bytes].
    delta_lights : int or None
        Number of its lights without extent; None in bakes older than this field, whose files hold no such light.
    file : str
        Path from the bake's directory: `LIGHT_NAME` inside it, or `../lights/SHA256.exr`, where bakes of one sky share
        it. See `rsibr.store.shared_light`.
    """

    sha256: str = Field(pattern=_SHA256)
    bytes: Size
    delta_lights: int | None = Field(None, ge=0)
    file: str = LIGHT_NAME

    @model_validator(mode="after")
    def _is_within_reach(self) -> Self:
        shared = _SHARED_LIGHT.fullmatch(self.file)
        if self.file != LIGHT_NAME and (shared is None or shared[1] != self.sha256):
            raise ValueError(f"its file is neither {LIGHT_NAME} nor ../{LIGHTS_NAME}/SHA256.exr")
        return self

    @property
    def is_shared(self) -> bool:
        """Whether the file lies outside the bake, where other bakes of the same sky read it too."""
        return self.file != LIGHT_NAME


class HealthRecord(Record):
    """Number of unreliable texels of a map when it was stored; `rsibr check` locates them.

    Attributes
    ----------
    non_finite, holes, fireflies, half_overflow : int
        Counts by kind; see `rsibr.store.health.MapHealth`.
    largest : float
        Largest finite radiance [W sr⁻¹ m⁻²].
    """

    non_finite: Size
    holes: Size
    fireflies: Size
    half_overflow: Size
    largest: float = Field(ge=0.0)


class SamplingRecord(Record):
    """Number and allocation of the samples; decided before the first view, and kept when the bake is resumed.

    Attributes
    ----------
    block : int
        Samples a block; the blocks of a texel are independent.
    even : int
        Blocks a texel if all have the same number, otherwise about the mean.
    scale : float or None
        Blocks per relative standard deviation of a texel, see `rsibr.baking.allocation`; None if all have the same
        number.
    gain : float or None
        Predicted ratio of the noise of uniform samples to that of allocated ones; None without a pilot.
    promised_rel_mse, promised_seconds : float or None
        Target of the config.
    forecast_rel_mse : float or None
        Noise of the maps predicted by the pilot, as relMSE, mean over the views.
    seconds : float
        Time from the beginning of the bake to this decision: probes, pilots, compilation of kernels [s].
    """

    block: int = Field(ge=1, le=2**25)
    even: int = Field(ge=2, le=2**40)
    scale: float | None = Field(None, gt=0.0)
    gain: float | None = None
    promised_rel_mse: float | None = None
    promised_seconds: float | None = None
    forecast_rel_mse: float | None = None
    seconds: Seconds = 0.0

    @property
    def samples(self) -> int:
        """Samples a texel, on average."""
        return self.block * self.even

    @property
    def identity(self) -> dict[str, Any]:
        """Values that determine the bits of the maps."""
        return {"block": self.block, "even": self.even, "scale": self.scale}


class ProbeRecord(Record):
    """Result of a probe: a small bake with few samples, compared with novel views.

    Attributes
    ----------
    resolution, views, samples : int
        Texels a side, stored views, and samples a texel of the probe.
    bias, upper : float
        RelMSE of the method `rsibr` without noise, mean over the probed views, and its upper confidence bound.
    noise : float
        RelMSE added by the noise of maps with so many samples.
    """

    resolution: int
    views: int
    samples: int
    bias: float
    upper: float
    noise: float


class BudgetRecord(Record):
    """Budget of the whole bake: what was promised, chosen and reached.

    Attributes
    ----------
    asked : dict
        The config as given, with its budget.
    resolved : dict
        The config that follows: without the budget, with the chosen values.
    promised_error, promised_seconds : float or None
        The budget itself.
    chosen : ProbeRecord
        Probe at the chosen size.
    probes : tuple of ProbeRecord
        All probes, in order.
    forecast_error : float
        Upper bound of the expected relMSE: that of the bias, plus the noise of the chosen samples.
    choice_seconds : float
        Time of the probes [s].
    reached_error, reached_ci95 : float, pair of float
        RelMSE at views independent of the choice, with its confidence interval over them; None until measured.
    reached_seconds : float or None
        Time of the whole bake [s], with the choice, without the measurement of `reached_error`; None until done.
    """

    asked: dict[str, Any]
    resolved: dict[str, Any]
    promised_error: float | None = None
    promised_seconds: float | None = None
    chosen: ProbeRecord
    probes: tuple[ProbeRecord, ...]
    forecast_error: float
    choice_seconds: Seconds
    reached_error: float | None = None
    reached_ci95: tuple[float, float] | None = None
    reached_seconds: Seconds | None = None


class CaptureRecord(Record):
    """Origin of maps that rsibr did not render: photographs, or maps of another renderer.

    Attributes
    ----------
    source : {"photographs", "import"}
        Where they come from.
    names : tuple of str
        Of each view: the file of its photograph, or what the import called it.
    distances : tuple of float or None
        From each camera to the sphere's centre, in its radii; None for maps seen from infinity.
    rectified : {"reflection", "normal"}
        What map and photograph have in common in a texel, and what views are compared by.
    variance : {"photographs", "spread", "given"}
        Of the texels: by the noise of merged exposures; by the spread of neighbouring pixels, an upper bound; or given.
    seen : tuple of float
        Share of the disk of each view that its photograph shows.
    saturated : tuple of int
        Texels of each view that hold radiance of which only a lower bound is known.
    gap_deg : float
        Largest circumradius of the triangles [degrees].
    is_partial : bool
        Whether the triangles leave part of the sphere of views open.
    notes : tuple of str
        What the one who made them was told.
    """

    source: Literal["photographs", "import"]
    names: tuple[str, ...]
    distances: tuple[Annotated[float, Field(gt=1.0)] | None, ...]
    rectified: Literal["reflection", "normal"]
    variance: Literal["photographs", "spread", "given"]
    seen: tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...]
    saturated: tuple[Size, ...]
    gap_deg: float = Field(gt=0.0, le=90.0)
    is_partial: bool = False
    notes: tuple[str, ...] = ()


class ViewState(Record):
    """State of one view of the bake.

    Attributes
    ----------
    index : int
        Index of the view in `Manifest.directions`.
    view : tuple of float
        Unit vector from the surface to the viewer, in world coordinates.
    file : str
        Path of the map inside the bake's directory.
    sha256, bytes, seconds
        Checksum and size [bytes] of the file, render time of the view [s]; None until done.
    done : bool
        Whether the file is complete.
    health : HealthRecord or None
        Findings in the map; None until done, and in bakes older than this record.
    noise : float or None
        RelMSE due to the noise of the map, from its variance; None until done, if a texel is not finite, and in bakes
        older than this field.
    """

    index: int = Field(ge=0)
    view: Vector
    file: str
    sha256: str | None = Field(None, pattern=_SHA256)
    seconds: Seconds | None = None
    bytes: Size | None = None
    done: bool = False
    health: HealthRecord | None = None
    noise: float | None = Field(None, ge=0.0)

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.file != map_name(self.index):  # also prevents paths outside the directory
            raise ValueError(f"view {self.index} has the file {self.file}")
        known = [value is not None for value in (self.sha256, self.seconds, self.bytes)]
        if not (all(known) if self.done else not any(known)):
            raise ValueError(f"view {self.index} has checksum, seconds and bytes if and only if it is done")
        if self.health is not None and not self.done:
            raise ValueError(f"view {self.index} is not done and cannot know its health")
        return self

    def pending(self) -> ViewState:
        """Return the same view with nothing done."""
        return ViewState(index=self.index, view=self.view, file=self.file)

    def finished(
        self, sha256: str, seconds: float, size: int, health: HealthRecord | None = None, noise: float | None = None
    ) -> ViewState:
        """Return the same view as done: checksum, render time [s] and size [bytes] of its file, findings, noise."""
        return ViewState(
            index=self.index,
            view=self.view,
            file=self.file,
            sha256=sha256,
            seconds=seconds,
            bytes=size,
            done=True,
            health=health,
            noise=noise,
        )


class Manifest(Record):
    """Metadata of a bake.

    Attributes
    ----------
    schema_version : int
        Version of this schema.
    config, config_hash
        The whole config as plain JSON data, with seeds, and the SHA-256 of its canonical form.
    identity : dict
        Values that determine the bits of the maps: two bakes with equal identity, directions, triangles and resolution
        are bit-identical.
    packages : dict of str to str
        Versions of the packages that the bake was made with.
    variant : str
        Mitsuba variant.
    environment, material
        Records of the two, for reports.
    lobes : tuple of LobeRecord
        Lobes of the material, which are layers of the maps; a single lobe is the layer "radiance". Empty if lobes are
        not separated.
    light : LightRecord or None
        File of the environment; None until written, and in bakes older than this record.
    resolution : int
        Texels along each side of a map.
    directions : tuple of vectors
        Unit view vectors, in world coordinates.
    triangles : tuple of index triples
        Triangulation of the directions, counter-clockwise seen from outside.
    views : tuple of ViewState
        State of each view, in the order of the directions.
    plan : Plan or None
        Effects that are simulated, with the evidence; None in bakes older than plans.
    sampling : SamplingRecord or None
        Number and allocation of the samples; None in bakes older than this record.
    budget : BudgetRecord or None
        Budget of the whole bake; None without one.
    capture : CaptureRecord or None
        Origin of maps that rsibr did not render: the config is then empty, and no material is known. None otherwise.
    wall_seconds : float
        Wall time of all runs that came to an end [s]: start-up, loading, probes, compilation, views, light. That of a
        run that was killed is missing.
    """

    schema_version: Literal[1] = SCHEMA_VERSION
    config: dict[str, Any]
    config_hash: str = Field(pattern=_SHA256)
    identity: dict[str, Any]
    packages: dict[str, str]
    variant: str = Field(pattern=_VARIANT)
    environment: EnvironmentRecord
    material: MaterialRecord
    lobes: tuple[LobeRecord, ...] = ()
    light: LightRecord | None = None
    resolution: int = Field(ge=1, le=MAX_RESOLUTION)
    directions: tuple[Vector, ...] = Field(min_length=1)
    triangles: tuple[Triangle, ...]
    views: tuple[ViewState, ...]
    plan: Plan | None = None
    sampling: SamplingRecord | None = None
    budget: BudgetRecord | None = None
    capture: CaptureRecord | None = None
    wall_seconds: Seconds = 0.0

    @classmethod
    def planned(
        cls,
        *,
        config: Mapping[str, Any],
        identity: Mapping[str, Any],
        packages: Mapping[str, str],
        variant: str,
        environment: EnvironmentRecord,
        material: MaterialRecord,
        lobes: tuple[LobeRecord, ...] = (),
        resolution: int,
        directions: ArrayLike,
        triangles: ArrayLike,
        plan: Plan | None = None,
        sampling: SamplingRecord | None = None,
        budget: BudgetRecord | None = None,
        capture: CaptureRecord | None = None,
    ) -> Manifest:
        """Manifest of a bake without finished views.

        Parameters
        ----------
        config, identity : mapping
            JSON data: dicts with string keys, lists, strings, finite numbers, booleans, None.
        packages, variant, environment, material, resolution, plan, sampling, budget, capture
            See the class.
        directions : array_like, shape (V, 3)
            Unit view vectors.
        triangles : array_like of int, shape (M, 3)
            Indices into `directions`.

        Raises
        ------
        ValueError
            If a number is not finite, or an index is out of range.
        TypeError
            If `config` or `identity` contains an object that is not JSON data.
        """
        rows = [(float(x), float(y), float(z)) for x, y, z in np.asarray(directions, np.float64)]
        # Keys keep their order, by which Mitsuba identifies nested plugins
        plain_config = json.loads(json.dumps(config, allow_nan=False))
        return cls(
            config=plain_config,
            config_hash=checksum(canonical(plain_config)),
            identity=json.loads(canonical(identity)),
            packages=dict(sorted(packages.items())),
            variant=variant,
            environment=environment,
            material=material,
            lobes=lobes,
            resolution=resolution,
            directions=tuple(rows),
            triangles=tuple((int(i), int(j), int(k)) for i, j, k in np.asarray(triangles, np.int64)),
            views=tuple(ViewState(index=i, view=row, file=map_name(i)) for i, row in enumerate(rows)),
            plan=plan,
            sampling=sampling,
            budget=budget,
            capture=capture,
        )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if [(state.index, state.view) for state in self.views] != list(enumerate(self.directions)):
            raise ValueError("the views are not the directions, in their order")
        if any(not 0 <= corner < len(self.directions) for triangle in self.triangles for corner in triangle):
            raise ValueError("a triangle names a view that does not exist")
        if len({lobe.name for lobe in self.lobes}) < len(self.lobes):
            raise ValueError("two lobes share a name")
        for lobe in self.lobes:
            if lobe.views is not None and not (lobe.views in VIEW_COUNTS and lobe.views < len(self.directions)):
                raise ValueError(f"{lobe.name} cannot be kept apart in {lobe.views} of {len(self.directions)} views")
        if self.config_hash != checksum(canonical(self.config)):
            raise ValueError("config_hash is not the hash of the config")
        return self

    @property
    def pending(self) -> list[int]:
        """Indices of the views that are not done, ascending."""
        return [state.index for state in self.views if not state.done]

    @property
    def seconds(self) -> float:
        """Render time of the finished views [s]."""
        return sum(state.seconds or 0.0 for state in self.views)

    @property
    def whole_seconds(self) -> float:
        """Time that the user waited for the bake [s]: with start-up, compilation and the light, where that is known."""
        return max(self.wall_seconds, self.total_seconds)

    @property
    def total_seconds(self) -> float:
        """Time from the beginning of the bake to its last map [s], with the decisions before the first one."""
        return self.seconds + (self.sampling.seconds if self.sampling else 0.0)

    @property
    def noise(self) -> float | None:
        """RelMSE due to the noise of the maps, mean over the finished views; None if it is unknown for one."""
        known = [state.noise for state in self.views if state.done]
        return sum(known) / len(known) if known and None not in known else None  # type: ignore[arg-type]

    @property
    def samples(self) -> int:
        """Samples a texel, on average; from the config in bakes older than `sampling`; 0 of a capture."""
        if self.capture is not None:
            return 0
        return self.sampling.samples if self.sampling else int(self.config["sampling"]["samples"])

    @property
    def size(self) -> int:
        """Size of the finished maps and of the environment [bytes]."""
        return sum(state.bytes or 0 for state in self.views) + (self.light.bytes if self.light else 0)

    def with_views(self, *states: ViewState) -> Manifest:
        """Return a copy with `states` at their indices."""
        views = list(self.views)
        for state in states:
            views[state.index] = state
        return self.model_copy(update={"views": tuple(views)})


def map_name(index: int) -> str:
    """Path of the map of view `index` inside the bake's directory."""
    return f"{MAPS_NAME}/view_{index:04d}.exr"


def write_manifest(path: Path, manifest: Manifest) -> None:
    """Write the manifest to the file `path`, atomically.

    Raises
    ------
    MachineError, BakeError
        If it cannot be written.
    """
    write_atomic(path, sealed(manifest.model_dump(mode="json")))


def read_manifest(path: Path) -> Manifest:
    """Read the manifest file `path` and check that it is unaltered, byte by byte.

    Raises
    ------
    BakeError
        If it cannot be read, is truncated or altered, or is of an unknown schema.
    """
    remedy = "bake anew with --fresh"
    data = read_bytes(path, most=LARGEST_MANIFEST)
    try:
        body = json.loads(data)
        del body["checksum"]
        version = body["schema_version"]
        # Re-encoding the content detects any change, of the checksum and of white space as well
        whole = data == sealed(body)
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise BakeError("is no manifest of a bake, or is truncated", where=str(path), fix=remedy) from error
    if type(version) is not int or version != SCHEMA_VERSION:
        what = f"has schema version {_cut(repr(version))}; this rsibr reads version {SCHEMA_VERSION}"
        raise BakeError(what, where=str(path), fix=f"{remedy}, or use the rsibr that wrote it")
    if not whole:
        raise BakeError("was altered: its checksum does not match", where=str(path), fix=remedy)
    try:
        return Manifest.model_validate_json(json.dumps(body), strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))
        told = first["msg"].removeprefix("Value error, ")
        what = f"is no valid manifest: {f'{_cut(place)}: ' if place else ''}{_cut(told)}"
        raise BakeError(what, where=str(path), fix=remedy) from error


def _cut(text: str) -> str:
    """Begin of a text of a stranger."""
    return printable(text if len(text) <= _LONGEST_PLACE else f"{text[:_LONGEST_PLACE]}…")


def canonical(value: Any) -> bytes:
    """Canonical JSON of `value`, for hashing: keys sorted, no spaces; ValueError if a number is not finite."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def sealed(body: dict[str, Any]) -> bytes:
    """Bytes of a JSON file: one key a line, for readers and diffs; the last is the checksum of the canonical form."""
    content = {**body, "checksum": checksum(canonical(body))}
    return (json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
