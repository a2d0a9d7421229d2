"""Systems of a comparison: a method with options and a number of stored views, and what it reads of a bake."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rsibr.errors import InputError, did_you_mean
from rsibr.methods.registry import registration
from rsibr.studies.agenda import BakeSize
from rsibr.studies.compare.config import CompareConfig


@dataclass(frozen=True)
class System:
    """A method with one setting: values of its options, and the stored views that it reads.

    Attributes
    ----------
    method : str
        Name of the method; all its settings together are one system.
    options : tuple of (str, value)
        Keyword options of the method that are not its defaults.
    views : int or None
        Stored views of the bake; None for a method that reads no stored maps.
    """

    method: str
    options: tuple[tuple[str, Any], ...] = ()
    views: int | None = None

    @property
    def label(self) -> str:
        """Name of the setting: `rsibr, 12 views`, `split-sum, size 128`."""
        options = [f"{name} {_shown(value)}" for name, value in self.options]
        return ", ".join([self.method, *options, *([] if self.views is None else [f"{self.views} views"])])

    @property
    def key(self) -> dict[str, Any]:
        """What the setting is, as JSON."""
        return {"method": self.method, "options": [list(pair) for pair in self.options], "views": self.views}


def reads_maps(method: str) -> bool:
    """Whether a method reads stored maps, so that its cost includes their rendering."""
    return bool(getattr(registration(method).needs, "maps", True))


def systems_of(
    config: CompareConfig, sizes: Mapping[BakeSize, int], methods: Sequence[str]
) -> dict[BakeSize, list[System]]:
    """Settings to measure on each bake.

    Parameters
    ----------
    config : CompareConfig
        Its `options` are the settings of each method.
    sizes : mapping of BakeSize to int
        Bakes of each scene, with their numbers of stored views. A method without stored maps is measured on the first.
    methods : sequence of str
        Names of the methods.

    Raises
    ------
    InputError
        If a method of `config.options` is unknown or has no such option.
    """
    settings = {name: _settings(config, name) for name in methods}
    found: dict[BakeSize, list[System]] = {size: [] for size in sizes}
    for number, (size, views) in enumerate(sizes.items()):
        for name in methods:
            if reads_maps(name):
                found[size] += [System(name, options, views) for options in settings[name]]
            elif number == 0:
                found[size] += [System(name, options) for options in settings[name]]
    return found


def check_options(config: CompareConfig) -> None:
    """Raise an InputError if `config.options` names an unknown method or option."""
    for name, tables in config.options.items():
        known = registration(name).options
        for option in (option for table in tables for option in table):
            if option not in known:
                there = f"there are: {', '.join(known) or 'none'}"
                where = f"{config.where}, options.{name}"
                raise InputError(
                    f"unknown option '{option}' of {name}", where=where, fix=did_you_mean(option, known) + there
                )


def _settings(config: CompareConfig, method: str) -> list[tuple[tuple[str, Any], ...]]:
    return [tuple(table.items()) for table in config.options.get(method, ({},))]


def _shown(value: Any) -> str:
    return {True: "on", False: "off"}[value] if isinstance(value, bool) else str(value)
