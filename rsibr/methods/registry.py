"""Registry of methods by name. A method registers itself in its own file; no other file refers to it by name.

Modules below `rsibr/methods/` are found by import, methods of installed packages by entry points of the group
`rsibr.methods`:

    [project.entry-points."rsibr.methods"]
    grey = "my_package.grey"
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from rsibr.errors import InputError, did_you_mean
from rsibr.methods.address import code_at, is_address
from rsibr.methods.method_name import parse_name
from rsibr.methods.protocol import Method, Needs
from rsibr.registered import import_all, keyword_options, load_entry_points
from rsibr.source_code import definition_digest, source_digest

if TYPE_CHECKING:
    from rsibr.scene.config import Config
    from rsibr.store.stored_maps import StoredMaps

ENTRY_POINTS = "rsibr.methods"
"""Entry-point group in which other packages declare methods."""

Role = Literal["default", "baseline", "plain"]
Factory = TypeVar("Factory", bound=Callable[..., Method])

_LAST = 100
_NOTHING = Needs()


@dataclass(frozen=True)
class Registration:
    """Entry of the registry: how to make a method from a bake.

    Attributes
    ----------
    name : str
        Name on the command line.
    summary : str
        Description in one line.
    make : callable
        `MethodInputs` → `Method`. Its keyword-only parameters are the method's options.
    needs : Needs
        Parts of a bake that the method requires.
    role : {"default", "baseline", "plain"}
        `default`: used if the user names no method. `baseline`: reference for comparisons, and used if the bake lacks
        something that the default requires.
    rank : int
        Position in tables, ascending.
    fixed : dict
        Values of options of `alias_of`, for an alias and for a name with options.
    listed : bool
        Whether tables, `validate` and `method_names` list it; an unlisted method is available by name.
    alias_of : str
        Method that this name is an alias of, with the options `fixed`; empty if it is not an alias.
    sees_delta_lights : bool
        For a method that needs the light: whether it takes lights without extent into account (`Light.delta`). If not,
        it is refused where there are any: it would be dark without a word.
    """

    name: str
    summary: str
    make: Callable[..., Method]
    needs: Needs = _NOTHING
    role: Role = "plain"
    rank: int = _LAST
    fixed: Mapping[str, Any] = field(default_factory=dict)
    alias_of: str = ""
    listed: bool = True
    sees_delta_lights: bool = False

    @property
    def options(self) -> dict[str, Any]:
        """Keyword parameters of `make` with their defaults, such as `weights`, `mesh`, `lobe`."""
        return keyword_options(self.make)

    def with_options(self, name: str, options: Mapping[str, Any]) -> Registration:
        """Return the method `name`, which is this one with values of some options.

        Raises
        ------
        InputError
            If the method has no such option; the message suggests the nearest one and lists all.
        """
        self.require_options(options, f"method {name}")
        make, fixed = partial(self.make, **options), {**self.fixed, **options}
        origin = self.alias_of or self.name
        return replace(self, name=name, make=make, role="plain", fixed=fixed, alias_of=origin, listed=False)

    def require_options(self, options: Iterable[str], where: str) -> None:
        """Raise an InputError that names the first of `options` that the method does not have."""
        for option in options:
            if option not in self.options:
                known = f"there are: {', '.join(self.options)}" if self.options else "it has none"
                fix = did_you_mean(option, self.options) + known
                raise InputError(f"{self.alias_of or self.name} has no option '{option}'", where=where, fix=fix)

    def serves(self, bake: StoredMaps) -> bool:
        """Whether the bake has all parts that the method requires, and the method sees all of its light."""
        held = {
            "views": bake.has_views,
            "maps": bake.view_count > 0,
            "light": bake.manifest.light is not None,
            "lobes": bool(bake.manifest.lobes),
        }
        return all(held[part] for part, needed in vars(self.needs).items() if needed) and self.sees_light_of(bake)

    def sees_light_of(self, bake: StoredMaps) -> bool:
        """Whether no part of the bake's light is invisible to the method."""
        light = bake.manifest.light
        return self.sees_delta_lights or not self.needs.light or light is None or not light.delta_lights


_REGISTERED: dict[str, Registration] = {}


def register(
    name: str,
    *,
    summary: str,
    needs: Needs = _NOTHING,
    role: Role = "plain",
    rank: int = _LAST,
    listed: bool = True,
    sees_delta_lights: bool = False,
) -> Callable[[Factory], Factory]:
    """Register a method; decorates its class, or a function that makes it.

    Parameters
    ----------
    name, summary, needs, role, rank, listed, sees_delta_lights
        See `Registration`.

    Returns
    -------
    callable
        Decorator of a callable that takes `MethodInputs` and returns a `Method`.

    Examples
    --------
    >>> @register("grey", summary="one grey for every surface and view")      # doctest: +SKIP
    ... class Grey(PointwiseMethod):
    ...     def eval(self, n, v):
    ...         return mi.Color3f(0.5)
    """

    def decorate(make: Factory) -> Factory:
        _REGISTERED[name] = Registration(
            name, summary, make, needs, role, rank, listed=listed, sees_delta_lights=sees_delta_lights
        )
        return make

    return decorate


def register_alias(name: str, *, of: str, summary: str, rank: int = _LAST, **fixed: Any) -> None:
    """Register an alias `name` of the method `of`, with some options `fixed`."""
    origin = _REGISTERED[of]

    def make(inputs: Any) -> Method:
        return origin.make(inputs, **fixed)

    _REGISTERED[name] = replace(
        origin, name=name, summary=summary, make=make, role="plain", rank=rank, fixed=fixed, alias_of=of, listed=True
    )


def unregister(name: str) -> None:
    """Remove a method from the registry; an unknown name is ignored."""
    _REGISTERED.pop(name, None)


def registrations() -> dict[str, Registration]:
    """All methods by name, ordered by rank."""
    _discover()
    return dict(sorted(_REGISTERED.items(), key=lambda item: item[1].rank))


def method_names() -> tuple[str, ...]:
    """Names of all listed methods, ordered by rank."""
    return tuple(name for name, one in registrations().items() if one.listed)


def registration(name: str) -> Registration:
    """Registration of the method `name`.

    Parameters
    ----------
    name : str
        Name of a registered method, or the address of one's own, `package.module:Class` (`rsibr.methods.address`); with
        values of options if any, `NAME,OPTION=VALUE` (`rsibr.methods.method_name`).

    Raises
    ------
    InputError
        If no method has this name, or it has no such option; the message suggests the nearest one and lists all. If the
        code at an address cannot be loaded.
    """
    base, options = parse_name(name)
    known = registrations()
    if base not in known and not is_address(base):
        named, _, rest = base.partition(",")
        if named in known:
            what, fix = (
                f"'{rest[:40]}' gives no option a value",
                "write NAME,OPTION=VALUE, as in rsibr,weights=area",
            )
            raise InputError(what, where=f"method {named}", fix=fix)
        there = f"there are: {', '.join(method_names())}"
        raise InputError(f"unknown method '{base}'", where="method", fix=did_you_mean(base, known) + there)
    found = known[base] if base in known else _at(base)
    return found.with_options(name, options) if options else found


def require_method_options(config: Config) -> None:
    """Raise an InputError if the config sets options that a method does not have (`Config.methods`)."""
    for name, options in (config.methods or {}).items():
        if parse_name(name)[1]:
            raise InputError("its name has options", where=f"methods.{name}", fix="give them as keys of the table")
        registration(name).require_options(options, f"methods.{name}")


def _at(address: str) -> Registration:
    """Registration of the method at an address: its own, if it is registered, otherwise what its class says."""
    make = code_at(address)
    for known in _REGISTERED.values():
        if known.make is make:
            return replace(known, name=address, role="plain", listed=False)
    summary = (make.__doc__ or address).strip().splitlines()[0]
    return Registration(address, summary, make, getattr(make, "needs", _NOTHING), listed=False)


def available(bake: StoredMaps) -> tuple[str, ...]:
    """Names of the listed methods whose requirements a bake meets, ordered by rank."""
    return tuple(name for name, one in registrations().items() if one.listed and one.serves(bake))


def default_method(bake: StoredMaps | None = None) -> str:
    """Name of the method to use if the user names none.

    Parameters
    ----------
    bake : StoredMaps, optional
        If it lacks something that the default requires, the baseline is returned, provided that the bake supports it.
    """
    by_role = {one.role: one for one in registrations().values()}
    usable = [by_role[role] for role in ("default", "baseline") if bake is None or by_role[role].serves(bake)]
    return (usable or [by_role["default"]])[0].name


def method_digest(name: str) -> str:
    """SHA-256 over the code of a method: all of `rsibr.methods`, and the package that defines the method.

    Parameters
    ----------
    name : str
        Name of a method; that of an alias stands for the method itself and its fixed options.
    """
    found = registration(name)
    make = registration(found.alias_of or name).make
    foreign = not make.__module__.startswith("rsibr.")
    code = [source_digest("rsibr.methods"), *([definition_digest(make)] if foreign else [])]
    return hashlib.sha256(f"{code} {dict(found.fixed)}".encode()).hexdigest()


def judged_by_lobe(name: str) -> bool:
    """Whether a validation evaluates single lobes too: for the default method, if it has the option `lobe`."""
    return name == default_method() and "lobe" in registration(name).options


def baseline_method() -> str:
    """Name of the reference method for comparisons."""
    return next(name for name, one in registrations().items() if one.role == "baseline")


@cache
def _discover() -> None:
    """Import every module of this package and every entry point, once; each registers its methods."""
    import_all("rsibr.methods")
    load_entry_points(ENTRY_POINTS)
