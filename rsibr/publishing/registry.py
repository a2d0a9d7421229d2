"""Registry of formats by name. A format registers itself in its own file; no other file refers to it by name.

Modules below `rsibr/publishing/formats/` are found by import, formats of installed packages by entry points of the
group `rsibr.publishing.formats`:

    [project.entry-points."rsibr.publishing.formats"]
    tables = "my_package.tables"
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Literal, TypeVar

from rsibr.errors import InputError, did_you_mean
from rsibr.methods.address import code_at, is_address
from rsibr.methods.method_name import parse_name
from rsibr.registered import import_all, keyword_options, load_entry_points

ENTRY_POINTS = "rsibr.publishing.formats"
"""Entry-point group in which other packages declare formats."""

Subject = Literal["view", "light"]


@dataclass(frozen=True)
class Encoded:
    """What a format made.

    Attributes
    ----------
    files : dict of str to bytes
        Content of each of the format's files, by its ending.
    notes : tuple of str
        What a user should know, such as values that the format cannot hold.
    """

    files: Mapping[str, bytes]
    notes: tuple[str, ...] = ()


Make = Callable[..., Encoded]
Encoder = TypeVar("Encoder", bound=Make)


@dataclass(frozen=True)
class Format:
    """Entry of the registry.

    Attributes
    ----------
    name : str
        Name on the command line.
    summary : str
        Description in one line.
    files : tuple of str
        Endings of the files that it writes: `latlong.exr` becomes `paint.latlong.exr`.
    make : callable
        `PublishedView`, or `PublishedLight`, → `Encoded`. Its keyword-only parameters are the format's options.
    of : {"view", "light"}
        Whether it shows the reflection of one view, or the light of the bake, once for all views.
    passes : bool
        Whether it needs the passes of a view (`PublishedView.passes`), which take two further maps.
    chosen : dict
        Options with values of a user's.
    """

    name: str
    summary: str
    files: tuple[str, ...]
    make: Make
    of: Subject = "view"
    passes: bool = False
    chosen: Mapping[str, Any] = field(default_factory=dict)

    @property
    def options(self) -> dict[str, Any]:
        """Keyword parameters of `make` with their defaults."""
        return keyword_options(self.make)

    def encode(self, subject: Any) -> Encoded:
        """Make the files of one view, or of the light.

        Raises
        ------
        InputError
            If an option has an invalid value, or the format cannot hold the subject. If it makes other files than it
            declares, which is a fault of the format.
        """
        made = self.make(subject, **self.chosen)
        found = tuple(made.files) if isinstance(made, Encoded) else (type(made).__name__,)
        if set(found) != set(self.files):
            what = f"declares the files {', '.join(self.files)} and makes {', '.join(found)}"
            raise InputError(what, where=f"format {self.name}", fix="mend its code")
        return made

    def with_options(self, options: Mapping[str, Any]) -> Format:
        """Return the format with values of some options.

        Raises
        ------
        InputError
            If it has no such option; the message suggests the nearest one and lists all.
        """
        for option in options:
            if option not in self.options:
                known = f"there are: {', '.join(self.options)}" if self.options else "it has none"
                fix = did_you_mean(option, self.options) + known
                raise InputError(f"{self.name} has no option '{option}'", where=f"format {self.name}", fix=fix)
        return replace(self, chosen={**self.chosen, **options})


_REGISTERED: dict[str, Format] = {}

_BY_CODE: dict[Make, Format] = {}
"""Formats by the function that makes them; a module that is run twice has two of a name."""


def register(
    name: str, *, summary: str, files: tuple[str, ...], of: Subject = "view", passes: bool = False
) -> Callable[[Encoder], Encoder]:
    """Register a format; decorates the function that makes its files.

    Parameters
    ----------
    name, summary, files, of, passes
        See `Format`.

    Returns
    -------
    callable
        Decorator of a callable that takes a `PublishedView` (or a `PublishedLight`) and returns `Encoded`.

    Examples
    --------
    >>> @register("raw", summary="float32, row by row", files=("f32",))                     # doctest: +SKIP
    ... def raw(view):
    ...     return Encoded({"f32": view.image.astype("<f4").tobytes()})
    """

    def decorate(make: Encoder) -> Encoder:
        _REGISTERED[name] = _BY_CODE[make] = Format(name, summary, files, make, of, passes)
        return make

    return decorate


def unregister(name: str) -> None:
    """Remove a format from the registry; an unknown name is ignored."""
    _REGISTERED.pop(name, None)


def formats() -> dict[str, Format]:
    """All formats by name, sorted."""
    _discover()
    return dict(sorted(_REGISTERED.items()))


def format_of(name: str, options: Mapping[str, Any] | None = None) -> Format:
    """Format of a name, with values of some options.

    Parameters
    ----------
    name : str
        Name of a registered format; `latlong` stands for `latlong-exr`, and so on. Or the address of a registered
        function of one's own (`rsibr.methods.address`).
    options : dict, optional
        Values by name of the option.

    Raises
    ------
    InputError
        If there is none, or it has no such option; the message suggests the nearest one and lists all. If the code at
        an address cannot be loaded, or is no format.
    """
    known = formats()
    if f"{name}-exr" in known:  # "latlong" of its kinds of file is the exact one
        name = f"{name}-exr"
    if name not in known and is_address(name):
        return _at(name).with_options(options or {})
    if name not in known:
        fix = did_you_mean(name, known) + f"there are: {', '.join(known)}"
        raise InputError(f"unknown format '{name}'", where="formats", fix=fix)
    return known[name].with_options(options or {})


def _at(address: str) -> Format:
    """Format that the module of an address registers with the function that it names."""
    found = _BY_CODE.get(code_at(address, "format"))
    if found is None:
        fix = "decorate it with rsibr.publishing.registry.register"
        raise InputError("is no format", where=f"format {address}", fix=fix)
    return found


def formats_of(names: Iterable[str]) -> list[Format]:
    """Formats of names with options, `NAME[,OPTION=VALUE]…`, several of them in one text divided by commas.

    Raises
    ------
    InputError
        As `format_of`; or if there is none, or one is named twice.

    Examples
    --------
    >>> [(one.name, dict(one.chosen)) for one in formats_of(["cube-exr,size=64,ktx2"])]
    [('cube-exr', {'size': 64}), ('ktx2', {})]
    """
    found = [format_of(*parse_name(text, "format")) for name in names for text in _separate(name)]
    twice = [one.name for k, one in enumerate(found) if one.name in {other.name for other in found[:k]}]
    if twice:
        raise InputError(f"{twice[0]} is named twice", where="formats", fix="name each format once")
    if not found:
        raise InputError("none is named", where="formats", fix=f"there are: {', '.join(formats())}")
    return found


def _separate(text: str) -> list[str]:
    """Divide `a,x=1,b` into `a,x=1` and `b`: what has no value of an option is the next name."""
    separate: list[str] = []
    depth = 0  # inside brackets and tables commas are those of a value
    for word in text.split(","):
        if depth == 0 and "=" not in word:
            separate.append(word.strip())
        else:
            separate[-1:] = [f"{separate[-1]},{word}" if separate else word]
        depth += sum(word.count(c) for c in "[{") - sum(word.count(c) for c in "]}")
    return [one for one in separate if one]


@cache
def _discover() -> None:
    """Import every module of formats and every entry point, once; each registers its formats."""
    import_all("rsibr.publishing.formats")
    load_entry_points(ENTRY_POINTS)
