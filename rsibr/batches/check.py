"""Checks of a batch that need Mitsuba: each distinct material, sky, view file and plugin module is loaded once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rsibr import backend
from rsibr.batches.job import Then
from rsibr.batches.matrix import Matrix, all_of
from rsibr.batches.sections import PLACEHOLDERS, canonical_text
from rsibr.errors import InputError, RsibrError
from rsibr.methods.registry import registration, require_method_options
from rsibr.progress import Progress
from rsibr.publishing.registry import formats_of
from rsibr.scene.config import Config, parse_config
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.scene.python_plugins import load_plugins
from rsibr.scene.trial import try_together
from rsibr.scene.views import load_viewpoints

Contents = Mapping[str, Mapping[str, str]]
"""For "environment" and "material": canonical text of a section → digest of its content."""


@backend.in_session
def check_contents(matrix: Matrix, on_progress: Callable[[Progress], None] = lambda _: None) -> Contents:
    """Load what the jobs name, so that a mistake in any of them is found before the first bake.

    Parameters
    ----------
    matrix : Matrix
        A batch that has passed `Matrix.check`.
    on_progress : callable
        Called after each material and environment.

    Returns
    -------
    dict
        Digests of the contents of environments and materials, by which a job is found to be done already.

    Raises
    ------
    InputError
        If Mitsuba rejects a material or an environment, it is not what a bake can use, a file of views does not cover
        the sphere, a plugin module cannot be imported, or a method or its option is unknown. All mistakes are told, or
        the first eight.
    MachineError
        If the machine has no usable backend.
    """
    backend.use()
    mistakes: list[str] = []
    for table in matrix.distinct("plugins"):
        _try(lambda table=table: load_plugins(table["modules"]), mistakes)  # type: ignore[misc]
    for table in matrix.distinct("views"):
        _try(lambda table=table: load_viewpoints(_config("views", table).views), mistakes)  # type: ignore[misc]
    for table in matrix.distinct("methods"):
        _try(lambda table=table: require_method_options(_config("methods", table)), mistakes)  # type: ignore[misc]
    _check_steps(matrix.config.tables.then.steps(), mistakes)
    if mistakes:  # without its plugins a material cannot be judged
        raise InputError(all_of(mistakes))
    contents = _loaded(matrix, mistakes, on_progress)
    if mistakes:
        raise InputError(all_of(mistakes))
    return contents


def _loaded(matrix: Matrix, mistakes: list[str], on_progress: Callable[[Progress], None]) -> Contents:
    """Load each material and environment; those that may crash Mitsuba were tried in another process before."""
    tables = [(kind, table) for kind in ("material", "environment") for table in matrix.distinct(kind)]
    total, contents = len(tables), {"environment": dict[str, str](), "material": dict[str, str]()}
    _try_together([_config(kind, table) for kind, table in tables])
    for done, (kind, table) in enumerate(tables, 1):
        config = _config(kind, table)

        def load(kind: str = kind, config: Config = config) -> str:
            if kind == "material":
                return load_material(config.material).digest
            return load_environment(config.environment).digest

        digest = _try(load, mistakes)
        contents[kind][canonical_text(table)] = digest or ""
        on_progress(Progress(done, total, f"checking {kind} {done} of {total}", 1.0))
    return contents


def _try_together(configs: Sequence[Config]) -> None:
    """Try what a user has given as plugins of Mitsuba; files of skies and presets need none."""
    custom: list[Any] = []
    for config in configs:
        if config.material.preset is None:
            custom.append(config.material)
        if config.environment.emitter not in (None, PLACEHOLDERS["environment"]["emitter"]):
            custom.append(config.environment)
    try_together(custom)


def _check_steps(then: Then, mistakes: list[str]) -> None:
    for name in (then.validate or {}).get("methods", ()):
        _try(lambda name=name: registration(name), mistakes, "then.validate.methods")  # type: ignore[misc]
    if then.publish:
        _try(lambda: formats_of(then.publish), mistakes, "then.publish")


def _config(section: str, table: Mapping[str, Any]) -> Config:
    """Config with one section of the batch."""
    return parse_config({**PLACEHOLDERS, section: table}, Path())


def _try(work: Callable[[], Any], mistakes: list[str], where: str = "") -> Any:
    """Result of `work`, or None and one more mistake."""
    try:
        return work()
    except RsibrError as error:
        if error.exit_code != InputError.exit_code:
            raise
        mistakes.append(f"{where}: {error}" if where else str(error))
        return None
