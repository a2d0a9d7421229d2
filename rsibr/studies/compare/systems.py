"""Systems and settings of a comparison: the settings of one method are one system."""

from __future__ import annotations

from collections.abc import Sequence

from rsibr.methods.method_name import parse_name
from rsibr.methods.registry import method_names, registration
from rsibr.studies.compare.config import CompareConfig


def system_of(name: str) -> str:
    """System that a method's name with options belongs to: `split-sum` of `split-sum,size=128`."""
    return parse_name(name)[0]


def label_of(name: str, views: int | None) -> str:
    """Name of a setting: the method's, and the stored views that it reads if any."""
    return name if views is None else f"{name}, {views} views"


def settings_of(config: CompareConfig, methods: Sequence[str] | None) -> list[str]:
    """Names of all methods to measure, with options.

    Parameters
    ----------
    config : CompareConfig
    methods : sequence of str, optional
        Names to take in place of the config's. Its further settings stay, of those systems that are compared.

    Raises
    ------
    InputError
        If there is no such method or option.
    """
    chosen = methods or config.method or method_names()
    systems = {system_of(name) for name in chosen}
    further = [name for name in config.settings if system_of(name) in systems]
    return [registration(name).name for name in dict.fromkeys([*chosen, *further])]


def systems_of(names: Sequence[str]) -> list[str]:
    """Systems of settings, in display order: registered ones by rank, then others."""
    found = list(dict.fromkeys(system_of(name) for name in names))
    ranks = {name: rank for rank, name in enumerate(method_names())}
    return sorted(found, key=lambda name: ranks.get(name, len(ranks)))
