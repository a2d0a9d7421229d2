"""Kinds of jobs: jobs of one kind cost the same, apart from the sky that they lie under."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rsibr.batches.job import Job
from rsibr.batches.sections import view_count
from rsibr.batches.values import label_of
from rsibr.scene.config import MapConfig, SamplingConfig, ViewsConfig

_PARTS = ("material", "views", "map", "sampling", "effects", "budget", "plugins")
"""Sections that determine what a job costs; the sky has little part in it."""


@dataclass(frozen=True)
class Size:
    """Size of a bake as its config states it; the defaults where a budget decides.

    Attributes
    ----------
    views : int
        Stored views.
    resolution : int
        Texels a side of a map.
    samples : int
        Samples a texel.
    """

    views: int
    resolution: int
    samples: int

    @property
    def texels(self) -> int:
        """Texels of all maps."""
        return self.views * self.resolution**2

    @property
    def samples_in_all(self) -> float:
        """Samples of the texels that the sphere covers, in all maps."""
        return math.pi / 4 * self.texels * self.samples


@dataclass
class Kind:
    """Jobs that cost the same.

    Attributes
    ----------
    group : str
        What decides on the rates, as text: material, effects, plugins, and how samples are drawn. Kinds of one group
        differ in size alone.
    material : str
        Short name of the material.
    size : Size
        As stated.
    seconds : float or None
        Duration of each job, if its config sets one [s].
    is_open : bool
        Whether an error or a duration decides on the size, which is then not known before.
    example : Job
        First of them.
    count : int
        Number of jobs.
    """

    group: str
    material: str
    size: Size
    seconds: float | None
    is_open: bool
    example: Job
    count: int = 0


@dataclass
class Census:
    """Counts jobs by kind, one after the other: `Matrix.check(census.add)`.

    Attributes
    ----------
    kinds : list of Kind
        In the order of their first jobs.
    jobs : int
        Number of jobs.
    """

    kinds: list[Kind] = field(default_factory=list)
    jobs: int = 0
    _by_sections: dict[tuple[int, ...], Kind] = field(default_factory=dict)
    _by_key: dict[tuple[Any, ...], Kind] = field(default_factory=dict)
    _skies: dict[int, Mapping[str, Any]] = field(default_factory=dict)
    _sky_example: dict[str, Job] = field(default_factory=dict)

    def add(self, job: Job) -> None:
        """Count a job. Its sections are shared with other jobs and stay alive: they are told apart by identity."""
        settings = job.settings
        key = tuple([id(settings.get(name)) for name in _PARTS])
        kind = self._by_sections.get(key)
        if kind is None:
            kind = self._by_sections[key] = self._kind_of(job)
        kind.count += 1
        self.jobs += 1
        if id(settings["environment"]) not in self._skies:
            self._skies[id(settings["environment"])] = settings["environment"]
            self._sky_example.setdefault(_text(settings["environment"]), job)

    @property
    def skies(self) -> int:
        """Number of distinct environments."""
        return len(self._sky_example)

    @property
    def sky_examples(self) -> list[Job]:
        """First job under each environment."""
        return list(self._sky_example.values())

    @property
    def materials(self) -> int:
        """Number of distinct materials."""
        return len({_text(kind.example.settings["material"]) for kind in self.kinds})

    def groups(self) -> dict[str, list[Kind]]:
        """Kinds by what decides on their rates."""
        found: dict[str, list[Kind]] = {}
        for kind in self.kinds:
            found.setdefault(kind.group, []).append(kind)
        return found

    def _kind_of(self, job: Job) -> Kind:
        settings = job.settings
        sampling, budget = SamplingConfig(**settings["sampling"]), settings.get("budget")
        views = ViewsConfig.model_validate(settings["views"])
        size = Size(view_count(views), MapConfig(**settings["map"]).side, sampling.count)
        drawn = {name: value for name, value in settings["sampling"].items() if name not in ("samples", "seed")}
        group = _text([settings["material"], settings["effects"], settings.get("plugins"), drawn, bool(budget)])
        seconds = sampling.time_budget_s or (budget or {}).get("seconds")
        key = (group, size, _text(settings["views"]), _text(budget), settings["map"]["resolution"] == "auto")
        kind = self._by_key.get(key)
        if kind is None:
            name = job.values.get("material") or label_of("material", settings["material"])
            is_open = sampling.decided_later or budget is not None
            kind = self._by_key[key] = Kind(group, str(name), size, seconds, is_open, job)
            self.kinds.append(kind)
        return kind


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)
