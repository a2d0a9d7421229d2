"""Mitsuba plugins written in Python: modules that register them are imported once for each variant.

Mitsuba keeps a registry of plugins per variant, and a class such as `class Coat(mi.BSDF)` derives from the base class
of the variant that was set when its module ran. A module of the plain idiom

    import mitsuba as mi

    class Coat(mi.BSDF):
        ...

    mi.register_bsdf("coat", Coat)

is therefore run again, with its submodules, in every variant that rsibr sets, each time in a namespace of its own. It
needs neither an entry function nor a loop over variants; calls of `mi.set_variant` in it are ignored.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mitsuba as mi

from rsibr import backend
from rsibr.errors import InputError
from rsibr.scene.fresh_import import imported_afresh

_KINDS = (
    "bsdf",
    "emitter",
    "film",
    "integrator",
    "medium",
    "phase",
    "rfilter",
    "sampler",
    "sensor",
    "shape",
    "texture",
)

_OF_THE_PARSER = ("rgb", "spectrum", "ref")
"""Types in a plugin's tables that are values, not plugins."""

_OWN = "rsibr_"
"""Prefix of the plugins shipped with rsibr, which every process registers."""


@dataclass(eq=False)
class _PluginModule:
    """Module of plugins, and the plugins that it registered.

    Attributes
    ----------
    name : str
        Name of the module, or path of its file.
    where : str
        Config key or option that names it.
    registered : dict
        Names of the plugins, for each variant in which it was imported.
    sources : list of Path
        Files of the module and of its submodules.
    digest : str
        SHA-256 of their content when they were imported.
    """

    name: str
    where: str
    registered: dict[str, set[str]] = field(default_factory=dict)
    sources: list[Path] = field(default_factory=list)
    digest: str = ""

    @property
    def is_current(self) -> bool:
        """Whether its files are unchanged since the import."""
        return self.digest == _digest(self.sources)

    @property
    def plugins(self) -> set[str]:
        """Names of the plugins that it registers in any variant."""
        return set().union(*self.registered.values())

    def register(self) -> None:
        """Import the module in the current variant, unless it was imported in it before."""
        variant = mi.variant()
        if variant in self.registered:
            return
        with _recorded() as names, backend.loading():
            modules = imported_afresh(self.name, self.where)
        if not names:
            raise InputError(
                f"'{self.name}' registers no plugin in the variant {variant}",
                where=self.where,
                fix="have it call mi.register_bsdf, mi.register_emitter or mi.register_texture when it is imported",
            )
        self.registered[variant] = names
        self.sources = sorted({Path(module.__file__) for module in modules if module.__file__})
        self.digest = _digest(self.sources)


_modules: dict[str, _PluginModule] = {}


def load_plugins(modules: Iterable[str], where: str = "plugins.modules") -> None:
    """Import modules that register Mitsuba plugins, in the current variant and in every variant that rsibr sets later.

    A module that was loaded before is imported again only if its files have changed.

    Parameters
    ----------
    modules : iterable of str
        Importable module names, or absolute paths that end in `.py`.
    where : str
        Config key or option that an error names.

    Raises
    ------
    InputError
        If a module does not exist, raises an error, or registers no plugin.
    """
    for name in modules:
        if name in _modules and _modules[name].is_current:
            continue
        module = _PluginModule(name, where)
        with backend.session():
            module.register()
        _modules[name] = module
        backend.on_variant(module.register)


def plugin_modules() -> tuple[str, ...]:
    """Names and paths of the modules loaded so far, to be loaded in other processes as well."""
    return tuple(_modules)


def sources_of(types: Iterable[str]) -> list[Path]:
    """Return the source files of the given plugins that come from loaded modules, for content digests."""
    wanted = set(types)
    return [path for module in _modules.values() if module.plugins & wanted for path in module.sources]


def registered_by_hand(types: Iterable[str]) -> list[str]:
    """Return the given plugins that neither Mitsuba nor a loaded module provides: other processes lack them."""
    known = {name for module in _modules.values() for name in module.plugins}.union(_OF_THE_PARSER)
    foreign = sorted({name for name in types if name not in known and not name.startswith(_OWN)})
    return [name for name in foreign if mi.PluginManager.instance().plugin_type(name) == mi.ObjectType.Unknown]


@contextmanager
def _recorded() -> Iterator[set[str]]:
    """Record the names of the plugins registered in the block, and ignore changes of variant."""
    names: set[str] = set()

    def recording(register: Callable[..., None]) -> Callable[..., None]:
        def record(name: str, constructor: Any) -> None:
            register(name, constructor)
            names.add(name)

        return record

    before = {name: getattr(mi, name) for name in [f"register_{kind}" for kind in _KINDS]}
    replaced = {name: recording(register) for name, register in before.items()} | {"set_variant": lambda *_: None}
    before["set_variant"] = mi.set_variant
    try:
        for name, value in replaced.items():
            setattr(mi, name, value)
        yield names
    finally:
        for name, value in before.items():
            setattr(mi, name, value)


def _digest(files: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes() if file.is_file() else b"")
    return digest.hexdigest()
