"""The manifest of a bake: what was asked for, what it was made with, and which views are done.

`manifest.json` is the last word: a map that it does not call done does not count, whatever lies in the directory.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from rsibr.errors import BakeError
from rsibr.geometry.viewpoints import VIEW_COUNTS
from rsibr.planning.plan import Plan
from rsibr.store.atomic import checksum, read_bytes, write_atomic

MANIFEST_NAME = "manifest.json"
MAPS_NAME = "maps"
SCHEMA_VERSION: Literal[1] = 1

_SHA256 = r"^[0-9a-f]{64}$"

Vector = tuple[float, float, float]
Triangle = tuple[int, int, int]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class EnvironmentRecord(_Record):
    """What is to be known about the environment: its name, its clipped negative values, the lowest of them."""

    name: str
    clipped: int = Field(0, ge=0)
    lowest: float = 0.0


class MaterialRecord(_Record):
    """What is to be known about the material: its name, the warp that suits its lobe, what maps cannot hold of it."""

    name: str
    warp: Literal["mirror", "normal"]
    notes: tuple[str, ...] = ()


class ProxyRecord(_Record):
    """One of the smooth lobes that stand in for a lobe of the material; see `rsibr.lobes.fit.ProxyLobe`.

    Attributes
    ----------
    alpha : float
        Its roughness.
    coefficients : tuple of colours
        Coefficient of each of its basis functions.
    """

    alpha: float
    coefficients: tuple[Vector, ...]


class LobeRecord(_Record):
    """One lobe of the material, stored as a layer of its name.

    Attributes
    ----------
    name : str
        Name of the layer.
    alpha : float
        Roughness of the lobe; see `rsibr.lobes.split.Lobe`.
    albedo : tuple of colours
        Its directional albedo over the viewing angle; see `rsibr.lobes.albedo`.
    proxies : tuple of ProxyRecord
        What stands in for it in a model of the lobe; none for a delta, and in bakes older than this record.
    views : int or None
        The first so many views have a layer of it, the others have it added to further lobes; None where all have, and
        in bakes older than this field. See `rsibr.store.layers`.
    """

    name: str
    alpha: float
    albedo: tuple[Vector, ...]
    proxies: tuple[ProxyRecord, ...] = ()
    views: int | None = Field(None, ge=1)


class LightRecord(_Record):
    """The file of the light: its checksum and its size [bytes]."""

    sha256: str = Field(pattern=_SHA256)
    bytes: int = Field(ge=0)


class HealthRecord(_Record):
    """Texels of one map that are not to be trusted, counted when it was stored; `rsibr check` shows where they are.

    Attributes
    ----------
    non_finite, holes, fireflies, half_overflow : int
        Counts by kind; see `rsibr.store.health.MapHealth`.
    largest : float
        Largest finite radiance [W sr⁻¹ m⁻²].
    """

    non_finite: int = Field(ge=0)
    holes: int = Field(ge=0)
    fireflies: int = Field(ge=0)
    half_overflow: int = Field(ge=0)
    largest: float


class SamplingRecord(_Record):
    """How many samples a bake takes, and where; decided before its first view, and kept when it is resumed.

    Attributes
    ----------
    block : int
        Samples of a block; the blocks of a texel are independent.
    even : int
        Blocks of a texel where all have as many, and about their mean where not.
    scale : float or None
        Blocks to the relative standard deviation of a texel, see `rsibr.baking.allocation`; None: all have as many.
    gain : float or None
        Predicted ratio of the noise of even samples to that of allocated ones; None where no pilot asked.
    promised_rel_mse, promised_seconds : float or None
        What the config asks for.
    forecast_rel_mse : float or None
        Noise of the maps that the pilot predicts, as relMSE, mean over the views.
    seconds : float
        From the beginning of the bake until this was decided: probes, pilots, kernels compiled.
    """

    block: int = Field(ge=1)
    even: int = Field(ge=2)
    scale: float | None = Field(None, gt=0.0)
    gain: float | None = None
    promised_rel_mse: float | None = None
    promised_seconds: float | None = None
    forecast_rel_mse: float | None = None
    seconds: float = Field(0.0, ge=0.0)

    @property
    def samples(self) -> int:
        """Samples a texel, on average."""
        return self.block * self.even

    @property
    def identity(self) -> dict[str, Any]:
        """What of it fixes the bits of the maps."""
        return {"block": self.block, "even": self.even, "scale": self.scale}


class ProbeRecord(_Record):
    """What a quick probe found: maps of few samples, held against views that are not among them.

    Attributes
    ----------
    resolution, views, samples : int
        Texels a side, stored views, and samples a texel of the probe.
    bias, upper : float
        RelMSE of the method `rsibr` without noise, mean over the probed views, and its upper confidence bound.
    noise : float
        RelMSE that the noise of maps of so many samples adds.
    """

    resolution: int
    views: int
    samples: int
    bias: float
    upper: float
    noise: float


class BudgetRecord(_Record):
    """What a budget of the whole bake promised, chose and reached.

    Attributes
    ----------
    asked : dict
        The config as it was asked for, with its budget.
    resolved : dict
        What was made of it: the same without a budget, and with the choice.
    promised_error, promised_seconds : float or None
        The budget itself.
    chosen : ProbeRecord
        Probe of the size that was chosen.
    probes : tuple of ProbeRecord
        All that were made, in their order.
    forecast_error : float
        RelMSE that is expected at most: upper bound of the bias, and the noise of the samples chosen.
    choice_seconds : float
        Time that the probes took.
    reached_error, reached_ci95 : float, pair of float
        RelMSE at views that took no part in the choice, with its confidence interval over them; None until measured.
    reached_seconds : float or None
        Time of the whole bake, choice included, the measurement of `reached_error` not; None until it is done.
    """

    asked: dict[str, Any]
    resolved: dict[str, Any]
    promised_error: float | None = None
    promised_seconds: float | None = None
    chosen: ProbeRecord
    probes: tuple[ProbeRecord, ...]
    forecast_error: float
    choice_seconds: float = Field(ge=0.0)
    reached_error: float | None = None
    reached_ci95: tuple[float, float] | None = None
    reached_seconds: float | None = Field(None, ge=0.0)


class ViewState(_Record):
    """One view of the bake, and its file once that is done.

    Attributes
    ----------
    index : int
        Place of the view in `Manifest.directions`.
    view : tuple of float
        Unit vector from the surface to the viewer, in world coordinates.
    file : str
        Path of the map inside the bake's directory.
    sha256, bytes, seconds
        Checksum and size [bytes] of the file, time that the view took to bake [s]; None until done.
    done : bool
        Whether the file is there, whole.
    health : HealthRecord or None
        What is wrong with the map; None until done, and in bakes older than this record.
    noise : float or None
        RelMSE that the noise of the map makes, from its variance; None until done, where a texel is not finite, and in
        bakes older than this field.
    """

    index: int = Field(ge=0)
    view: Vector
    file: str
    sha256: str | None = Field(None, pattern=_SHA256)
    seconds: float | None = Field(None, ge=0.0)
    bytes: int | None = Field(None, ge=0)
    done: bool = False
    health: HealthRecord | None = None
    noise: float | None = Field(None, ge=0.0)

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.file != map_name(self.index):  # also keeps a forged manifest from pointing out of the directory
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
        """Return the same view with its file: checksum, time it took [s], size [bytes], what is wrong with the map."""
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


class Manifest(_Record):
    """All that a bake knows of itself besides the pixels.

    Attributes
    ----------
    schema_version : int
        Version of this schema.
    config, config_hash
        The whole configuration as JSON holds it, seeds included, and the SHA-256 of its canonical form.
    identity : dict
        Everything that fixes the bits of the maps: two bakes with equal identity, directions, triangles and resolution
        are bit-identical.
    packages : dict of str to str
        Versions of the packages that the bake was made with.
    variant : str
        Mitsuba variant.
    environment, material
        What is to be known about them, for reports.
    lobes : tuple of LobeRecord
        The material's lobes, layers of the maps; one lobe alone is the layer "radiance"; none where they are not kept
        apart.
    light : LightRecord or None
        The light that the model of each lobe is made from; None until written, and in bakes older than this record.
    resolution : int
        Texels along each side of a map.
    directions : tuple of vectors
        Unit view vectors, in world coordinates.
    triangles : tuple of index triples
        Triangulation of the directions, counter-clockwise seen from outside.
    views : tuple of ViewState
        State of each view, in the order of the directions.
    plan : Plan or None
        Which effects are simulated, and why; None in bakes older than plans.
    sampling : SamplingRecord or None
        How many samples are taken, and where; None in bakes older than this record.
    budget : BudgetRecord or None
        What a budget of the whole bake chose; None without one.
    """

    schema_version: Literal[1] = SCHEMA_VERSION
    config: dict[str, Any]
    config_hash: str = Field(pattern=_SHA256)
    identity: dict[str, Any]
    packages: dict[str, str]
    variant: str
    environment: EnvironmentRecord
    material: MaterialRecord
    lobes: tuple[LobeRecord, ...] = ()
    light: LightRecord | None = None
    resolution: int = Field(ge=1)
    directions: tuple[Vector, ...] = Field(min_length=1)
    triangles: tuple[Triangle, ...]
    views: tuple[ViewState, ...]
    plan: Plan | None = None
    sampling: SamplingRecord | None = None
    budget: BudgetRecord | None = None

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
    ) -> Manifest:
        """Manifest of a bake of which nothing is done yet.

        Parameters
        ----------
        config, identity : mapping
            What JSON can hold: dicts with string keys, lists, strings, finite numbers, booleans, None.
        packages, variant, environment, material, resolution, plan, sampling, budget
            See the class.
        directions : array_like, shape (V, 3)
            Unit view vectors.
        triangles : array_like of int, shape (M, 3)
            Indices into `directions`.

        Raises
        ------
        ValueError
            If a number is not finite or an index out of range.
        TypeError
            If `config` or `identity` holds an object that JSON does not know.
        """
        rows = [(float(x), float(y), float(z)) for x, y, z in np.asarray(directions, np.float64)]
        plain_config = json.loads(json.dumps(config, allow_nan=False))  # in its order: Mitsuba nests plugins by it
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
        )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if [(state.index, state.view) for state in self.views] != list(enumerate(self.directions)):
            raise ValueError("the views are not the directions, in their order")
        if any(not 0 <= corner < len(self.directions) for triangle in self.triangles for corner in triangle):
            raise ValueError("a triangle names a view that does not exist")
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
        """Time that the views done so far took to bake [s]."""
        return sum(state.seconds or 0.0 for state in self.views)

    @property
    def total_seconds(self) -> float:
        """Time from the beginning of the bake to its last map, what was decided before the first one included [s]."""
        return self.seconds + (self.sampling.seconds if self.sampling else 0.0)

    @property
    def noise(self) -> float | None:
        """RelMSE that the noise of the maps makes, mean over the views done; None where one does not know its own."""
        known = [state.noise for state in self.views if state.done]
        return sum(known) / len(known) if known and None not in known else None  # type: ignore[arg-type]

    @property
    def samples(self) -> int:
        """Samples a texel, on average; of bakes older than their record, those of the config."""
        return self.sampling.samples if self.sampling else int(self.config["sampling"]["samples"])

    @property
    def size(self) -> int:
        """Size of the maps done so far, and of the light [bytes]."""
        return sum(state.bytes or 0 for state in self.views) + (self.light.bytes if self.light else 0)

    def with_views(self, *states: ViewState) -> Manifest:
        """Return a copy in which each of `states` stands at its index."""
        views = list(self.views)
        for state in states:
            views[state.index] = state
        return self.model_copy(update={"views": tuple(views)})


def map_name(index: int) -> str:
    """Path of the map of view `index` inside the bake's directory."""
    return f"{MAPS_NAME}/view_{index:04d}.exr"


def write_manifest(path: Path, manifest: Manifest) -> None:
    """Write the manifest to the file `path`, whole or not at all.

    Raises
    ------
    MachineError, BakeError
        If it cannot be written.
    """
    write_atomic(path, _file_content(manifest.model_dump(mode="json")))


def read_manifest(path: Path) -> Manifest:
    """Read the manifest file `path` and check that it is as it was written, byte by byte.

    Raises
    ------
    BakeError
        If it cannot be read, is truncated or altered, or is of an unknown schema.
    """
    remedy = "bake anew with --fresh"
    data = read_bytes(path)
    try:
        body = json.loads(data)
        del body["checksum"]
        version = body["schema_version"]
        # Our own bytes for the same content: finds a changed checksum, and a changed space as well.
        whole = data == _file_content(body)
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise BakeError("is no manifest of a bake, or is truncated", where=str(path), fix=remedy) from error
    if version != SCHEMA_VERSION:
        what = f"has schema version {version!r}; this rsibr reads version {SCHEMA_VERSION}"
        raise BakeError(what, where=str(path), fix=f"{remedy}, or use the rsibr that wrote it")
    if not whole:
        raise BakeError("was altered: its checksum does not match", where=str(path), fix=remedy)
    try:
        return Manifest.model_validate_json(json.dumps(body))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise BakeError(f"is no valid manifest: {place}: {first['msg']}", where=str(path), fix=remedy) from error


def canonical(value: Any) -> bytes:
    """Return the one JSON text of `value`, for hashing: keys sorted, no spaces, finite numbers only (ValueError)."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def _file_content(body: dict[str, Any]) -> bytes:
    """Bytes of the file: one key a line, for people and for diffs; the checksum over the canonical form comes last."""
    content = {**body, "checksum": checksum(canonical(body))}
    return (json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
