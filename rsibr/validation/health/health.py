"""Numerical health of a whole bake: findings, their places, and images of them."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene.config import config_of
from rsibr.scene.environment import Environment, load_environment
from rsibr.scene.python_plugins import load_plugins
from rsibr.store.bake import Bake
from rsibr.store.health import MapHealth, map_health
from rsibr.store.map_file import MapFile
from rsibr.validation.health.energy import ERRORS, Drift, MapMeans, drifting_views, mean_of_map
from rsibr.validation.health.photographs.judgement import Judgement, judged
from rsibr.validation.report.pictures import RELATIVE_ERROR, Rgba, false_colour, outlined
from rsibr.validation.singularity import near_singularity

Verdict = Literal["failed", "warning"]

KINDS: dict[str, tuple[Verdict, str]] = {
    "non_finite": ("failed", "NaN or Inf"),
    "holes": ("failed", "inside the disk but not covered"),
    "fireflies": ("warning", "dominated by a few bright samples, unlike its neighbours"),
    "half_overflow": ("warning", "above 65504, Inf in half precision"),
}
"""Kinds of findings in a map: verdict and meaning of each."""

MARKS = {
    "non_finite": (0, 229, 255),
    "holes": (57, 255, 20),
    "fireflies": (64, 140, 255),
    "half_overflow": (150, 160, 170),
}
"""Colour of the outline around a texel by kind; none occurs on the false-colour scale."""

SCALE = replace(RELATIVE_ERROR, label="relative standard error of a texel")

MOST_PLACES = 8
"""Maximum number of places of each kind, the worst first."""

MOST_PICTURES = 6
"""Maximum number of views to draw: those with most findings, or the noisiest one if there are no findings."""


@dataclass(frozen=True)
class Place:
    """Place of a texel.

    Attributes
    ----------
    view : int
        Index of the stored view.
    row, column : int
        Row and column of the image; row 0 is the top.
    s, t : float
        Centre of the texel in the sphere map, s right, t up.
    normal, reflection : tuple of float
        Surface normal and mirror direction, unit vectors in world coordinates.
    value : float or None
        Relative standard error of a firefly, or radiance of an overflow; None if infinite, and for other kinds.
    """

    view: int
    row: int
    column: int
    s: float
    t: float
    normal: tuple[float, float, float]
    reflection: tuple[float, float, float]
    value: float | None


@dataclass(frozen=True)
class Finding:
    """All texels of one kind.

    Attributes
    ----------
    kind : str
        Key of `KINDS`.
    verdict : str
        `"failed"` or `"warning"`.
    meaning : str
        Description of the kind.
    texels, views : int
        Number of texels, and of views with such texels.
    places : tuple of Place
        At most `MOST_PLACES`, the worst first.
    """

    kind: str
    verdict: Verdict
    meaning: str
    texels: int
    views: int
    places: tuple[Place, ...]

    def __str__(self) -> str:
        """Return the finding in one line: `2 texels in 1 view: non-finite (NaN or Inf)`."""
        texels, views = ("" if count == 1 else "s" for count in (self.texels, self.views))
        return (
            f"{self.texels} texel{texels} in {self.views} view{views}: {self.kind.replace('_', '-')} ({self.meaning})"
        )


@dataclass(frozen=True)
class CaptureHealth:
    """Health of a capture.

    Attributes
    ----------
    judgement : Judgement
        Maps that do not fit the others.
    covered : float
        Share of the sphere of views that lies between stored ones.
    largest_circumradius_deg : float
        Largest distance of a view between stored ones from all of them.
    seen : float
        Share of the maps' texels that were seen.
    variance : str
        Where the variance comes from; see `CaptureRecord`.
    notes : tuple of str
        What was said when it was made.
    """

    judgement: Judgement
    covered: float
    largest_circumradius_deg: float
    seen: float
    variance: str
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Health:
    """Result of `rsibr check`.

    Attributes
    ----------
    bake : str
        Path of the bake.
    views, texels : int
        Number of stored views, and of texels inside the disk of all views.
    findings : dict of str to Finding
        Finding for each of `KINDS`, also if it has no texels.
    largest : float
        Largest finite radiance of all maps [W sr⁻¹ m⁻²].
    relative_error : float
        Median relative standard error of all texels.
    drifts : tuple of Drift
        Views whose mean radiance is inconsistent with the other views.
    above_light : tuple of int
        Views with a mean radiance above the environment's maximum, which no albedo ≤ 1 can reflect.
    energy_note : str
        Reason why drift was not tested; empty if it was.
    near_singularity : float or None
        See `rsibr.validation.singularity.near_singularity`; None for a bake that is warped by the normal.
    clamp : float or None
        `sampling.clamp` of the bake.
    capture : CaptureHealth or None
        What is said of a capture; None for a bake that was rendered.
    pictures : dict of int to ndarray, shape (N, N, 4), uint8
        Relative standard error of some views in false colour, with texels of findings outlined in the colours of
        `MARKS`.
    """

    bake: str
    views: int
    texels: int
    findings: dict[str, Finding]
    largest: float
    relative_error: float
    drifts: tuple[Drift, ...]
    above_light: tuple[int, ...]
    energy_note: str
    near_singularity: float | None
    clamp: float | None
    capture: CaptureHealth | None
    pictures: dict[int, Rgba]

    def __repr__(self) -> str:
        verdict = "trusted" if self.trusted else "unusable"
        return f"Health({self.views} views, {self.texels} texels: {verdict}, {self.warnings} warnings)"

    @property
    def trusted(self) -> bool:
        """Whether the maps are usable: no texel is NaN, Inf or missing."""
        return not any(finding.texels for finding in self.findings.values() if finding.verdict == "failed")

    @property
    def warnings(self) -> int:
        """Number of kinds of warnings: findings that do not make the maps unusable."""
        texels = sum(finding.texels > 0 for finding in self.findings.values() if finding.verdict == "warning")
        suspects = self.capture is not None and bool(self.capture.judgement.suspects)
        return texels + bool(self.drifts) + bool(self.above_light) + (self.clamp is not None) + suspects


def assess(
    bake: Bake,
    views: Sequence[NDArray[np.float64]],
    environment: Callable[[], Environment] | None = None,
    maps: Iterable[MapFile] | None = None,
) -> Health:
    """Assess every map of a bake, all maps jointly, and lookups of novel views near singularities.

    Parameters
    ----------
    bake : Bake
        A finished bake. If its environment file is missing or has changed, drift is not tested.
    views : sequence of ndarray, shape (3,)
        Novel view directions, for the share of texels near a singularity.
    environment : callable, optional
        Returns the environment of the bake, or raises an `InputError`; by default it is loaded.
    maps : iterable of MapFile, optional
        Maps of the bake if they are decoded already; by default they are read one by one.

    Returns
    -------
    Health

    Notes
    -----
    Probability of false alarms: fireflies below 1e-5 for each texel of a bake of 4 to 11 samples, none observed with
    more samples (`rsibr.store.health`); drift below 1e-3 for each bake with Gaussian residuals
    (`rsibr.validation.health.energy`); bound by the environment below 3e-7 for each channel of a view. Other findings
    are counts, not statistical tests.
    """
    backend.use()
    captured = bake.manifest.capture is not None
    if captured and maps is None:
        maps = [bake.map(index) for index in range(bake.view_count)]
    survey = _Survey(map(bake.map, range(bake.view_count)) if maps is None else maps, captured=captured)
    drifts, above, note = _judge_energy(bake, survey.means, environment or partial(_environment_of, bake))
    return Health(
        bake=str(bake.path),
        views=bake.view_count,
        texels=survey.texels,
        findings=survey.findings(),
        largest=survey.largest,
        relative_error=float(np.median(survey.relative_errors)) if survey.relative_errors else 0.0,
        drifts=tuple(drifts),
        above_light=tuple(above),
        energy_note=note,
        near_singularity=_near_singularity(bake, views),
        clamp=bake.config.get("sampling", {}).get("clamp"),
        capture=_capture_health(bake, list(maps)) if captured and maps is not None else None,
        pictures=survey.pictures(),
    )


class _Survey:
    """Single pass over all maps of a bake."""

    def __init__(self, maps: Iterable[MapFile], *, captured: bool = False) -> None:
        self._captured = captured
        self.texels = 0
        self.largest = 0.0
        self.relative_errors: list[float] = []
        self._masks = {kind: [0, 0] for kind in KINDS}
        self._places: dict[str, list[tuple[float, Place]]] = {kind: [] for kind in KINDS}
        self._drawn: list[tuple[int, float, int, Rgba]] = []
        means, errors = zip(*(self._see(index, map_file) for index, map_file in enumerate(maps)), strict=True)
        self.means = MapMeans(np.stack(means), np.stack(errors))

    def findings(self) -> dict[str, Finding]:
        found = {}
        for kind, (verdict, meaning) in KINDS.items():
            texels, views = self._masks[kind]
            places = tuple(place for _, place in self._places[kind])
            found[kind] = Finding(kind, verdict, meaning, texels, views, places)
        return found

    def pictures(self) -> dict[int, Rgba]:
        """Return images of the views with most findings, or of the noisiest one if there are no findings."""
        worst = [drawn for drawn in self._drawn if drawn[0]] or self._drawn[:1]
        return {view: picture for _, _, view, picture in worst}

    def _see(self, index: int, map_file: MapFile) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        seen = map_health(map_file, captured=self._captured)
        self.texels += int((map_file.coverage > 0).sum())
        self.largest = max(self.largest, seen.largest)
        self._note_noise(index, seen)
        for kind, mask in seen.found.items():
            self._masks[kind][0] += int(mask.sum())
            self._masks[kind][1] += bool(mask.any())
            self._note_places(kind, index, map_file, seen)
        variance = map_file.variance if map_file.variance is not None else np.zeros((*map_file.coverage.shape, 3))
        sound = (map_file.coverage > 0) & ~seen.found["non_finite"]
        radiance = np.stack(list(map_file.layers.values()))[:, sound].sum(axis=0, dtype=np.float64)
        weight = map_file.coverage[sound].astype(np.float64)
        return mean_of_map(radiance, variance[sound].astype(np.float64), weight)

    def _note_noise(self, index: int, seen: MapHealth) -> None:
        known = seen.relative_error[np.isfinite(seen.relative_error)]
        noise = float(np.median(known)) if known.size else 0.0
        self.relative_errors.append(noise)
        count = sum(int(mask.sum()) for mask in seen.found.values())
        least = self._drawn[-1][:2] if len(self._drawn) == MOST_PICTURES else (-1, -1.0)
        if (count, noise) > least:
            self._drawn.append((count, noise, index, _drawn(seen)))
            self._drawn = heapq.nlargest(MOST_PICTURES, self._drawn, key=lambda drawn: drawn[:2])

    def _note_places(self, kind: str, index: int, map_file: MapFile, seen: MapHealth) -> None:
        cells = np.argwhere(seen.found[kind])
        badness = _badness(kind, map_file, seen)[tuple(cells.T)]
        for i in np.argsort(-badness, kind="stable")[:MOST_PLACES]:
            row, column = cells[i].tolist()
            value = float(badness[i])
            self._places[kind].append((value, _place(index, map_file, row, column, value if value else None)))
        self._places[kind] = heapq.nlargest(MOST_PLACES, self._places[kind], key=lambda entry: entry[0])


def _badness(kind: str, map_file: MapFile, seen: MapHealth) -> NDArray[np.float64]:
    """Values by which texels of a kind are ranked, the worst highest; 0 if the kind has no ranking."""
    if kind == "fireflies":
        return seen.relative_error
    if kind == "half_overflow":
        layers = np.stack(list(map_file.layers.values()))
        return np.asarray(np.where(np.isfinite(layers), layers, 0).max(axis=(0, 3)), dtype=np.float64)
    return np.zeros(map_file.coverage.shape)


def _place(index: int, map_file: MapFile, row: int, column: int, value: float | None) -> Place:
    count = map_file.resolution
    x, y = (column + 0.5) * 2 / count - 1, 1 - (row + 0.5) * 2 / count
    shrink = max(1.0, float(np.hypot(x, y)))
    x, y = x / shrink, y / shrink
    normal = map_file.frame @ np.array([x, y, np.sqrt(max(0.0, 1 - x * x - y * y))])
    reflection = 2 * (normal @ map_file.view) * normal - map_file.view
    s, t = (column + 0.5) / count, 1 - (row + 0.5) / count
    finite = value if value is not None and np.isfinite(value) else None
    return Place(index, row, column, s, t, _rounded(normal), _rounded(reflection), finite)


def _rounded(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    """Round to six digits, and replace −0 by 0."""
    x, y, z = (round(float(component), 6) + 0.0 for component in vector)
    return x, y, z


def _drawn(seen: MapHealth) -> Rgba:
    picture = false_colour(seen.relative_error, SCALE)
    for kind, mask in seen.found.items():
        picture = outlined(picture, mask, MARKS[kind])
    return picture


def _environment_of(bake: Bake) -> Environment:
    config = config_of(bake.config)
    load_plugins(config.plugin_modules)
    return load_environment(config.environment)


def _judge_energy(bake: Bake, means: MapMeans, load: Callable[[], Environment]) -> tuple[list[Drift], list[int], str]:
    """Drifting views, views brighter than the environment, and the reason if they could not be tested."""
    if bake.manifest.capture is not None:
        return [], [], "the maps were captured; each was held against the others instead"
    try:
        environment = load()
    except InputError as error:
        return [], [], f"the environment cannot be loaded: {error}"
    if bake.manifest.identity["environment"]["content"] != environment.digest:
        return [], [], "the environment has changed since the bake"
    drifts = drifting_views(means, bake.directions, environment.emitter())
    brightest = _brightest(environment)
    if brightest is None:
        return drifts, [], ""
    above = (means.mean > brightest * (1 + 1e-4) + ERRORS * means.error).any(axis=1)
    return drifts, np.flatnonzero(above).tolist(), ""


def _brightest(environment: Environment) -> NDArray[np.float64] | None:
    """Maximum radiance of an environment image for each channel; None for other emitters."""
    return None if environment.image is None else environment.image.max(axis=(0, 1)).astype(np.float64)


def _near_singularity(bake: Bake, views: Sequence[NDArray[np.float64]]) -> float | None:
    if bake.manifest.material.warp != "mirror" or not bake.has_views or not len(views):
        return None
    between = [view for view in views if bake.viewpoints.covers(view).all()]
    return near_singularity(bake.viewpoints, between) if between else None


def _capture_health(bake: Bake, maps: Sequence[MapFile]) -> CaptureHealth:
    record, views = bake.manifest.capture, bake.viewpoints
    assert record is not None
    return CaptureHealth(
        judged(maps, record.names, record.rectified),
        views.covered,
        math.degrees(views.largest_circumradius),
        sum(record.seen) / len(record.seen),
        record.variance,
        record.notes,
    )
