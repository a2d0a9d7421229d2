"""Choice of the channels of an OpenEXR file that are the environment: its parts, layers and views."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rsibr.errors import InputError

KEY = "environment.layer"
"""Config key that chooses among several pictures."""

Header = Mapping[str, Any]
"""Header of a part, as `OpenEXR.File.header` returns it."""

_RGB = ("R", "G", "B")
_XYZ = ("X", "Y", "Z")
_LISTED = 20
"""Names listed at most in an error."""


@dataclass(frozen=True)
class Candidate:
    """Channels of one part that form a picture.

    Attributes
    ----------
    part : int
        Index of the part.
    part_name : str
        Its name; empty if it has none.
    layer : str
        Prefix of the channels' names without its dot; empty for channels without one.
    channels : tuple of str
        Full names of three channels, or of one that is grey.
    """

    part: int
    part_name: str
    layer: str
    channels: tuple[str, ...]

    @property
    def xyz(self) -> bool:
        """Whether the channels are CIE XYZ."""
        return self.channels[-1].endswith("Z")


def choose(headers: Sequence[Header], layer: str | None) -> tuple[Candidate, tuple[str, ...]]:
    """Choose the picture of a file.

    Parameters
    ----------
    headers : sequence of mappings
        Header of each part.
    layer : str, optional
        Name of a layer, a part or a view (`multiView`), or `part/layer`; by default the only picture, or in a file of
        one part the channels without a layer, which OpenEXR defines as its default.

    Returns
    -------
    chosen : Candidate
    notes : tuple of str
        Which pictures were left aside.

    Raises
    ------
    InputError
        If there is no picture, several without a default, or none of that name; `where` is left to the caller.
    """
    found = [candidate for index, header in enumerate(headers) for candidate in _candidates(index, header)]
    if not found:
        raise _no_picture(headers)
    names = {candidate: _names(candidate, headers, found) for candidate in found}
    if layer is not None:
        return _named(layer, names), ()
    colours = [candidate for candidate in found if not candidate.layer or not candidate.xyz]
    if len(found) == 1 or len(colours) == 1:  # X, Y and Z of a layer may as well be a position
        return (colours or found)[0], ()
    default = [candidate for candidate in found if not candidate.layer]
    if len(headers) == 1 and default:
        others = [names[candidate][0] for candidate in found if candidate.layer]
        return default[0], (f"its layers {_listed(others)} are left aside ({KEY} takes one of them)",)
    raise InputError(
        f"holds several pictures: {_listed([names[candidate][0] for candidate in found])}",
        fix=f"choose one with {KEY}",
    )


def _named(layer: str, names: Mapping[Candidate, list[str]]) -> Candidate:
    # A name of one kind before the next: a part's own picture before a layer of that name in another part
    ranks = max(map(len, names.values()))
    for rank in range(ranks):
        matching = [candidate for candidate, known in names.items() if layer in known[rank : rank + 1]]
        if len(matching) == 1:
            return matching[0]
        if matching:
            break
    told = [known[0] for known in names.values()]
    what = "several pictures" if any(layer in known for known in names.values()) else "no picture"
    raise InputError(f"has {what} named '{layer}', but {_listed(told)}", fix=f"correct {KEY}")


def _names(candidate: Candidate, headers: Sequence[Header], found: Sequence[Candidate]) -> list[str]:
    """Names by which a picture can be chosen; the first is unique, and the one that messages show."""
    header = headers[candidate.part]
    views = header.get("multiView")
    view = str(header.get("view", "")) if not candidate.layer else ""
    if not candidate.layer and isinstance(views, list) and views:
        view = str(views[0])  # the default view has no prefix
    own = [candidate.layer] if candidate.layer else [*filter(None, [view]), "RGB"]
    if len(headers) == 1:
        return own
    part = candidate.part_name or f"part {candidate.part}"
    alone = sum(other.part == candidate.part for other in found) == 1
    full = f"{part}/{candidate.layer}" if candidate.layer else part
    first = part if alone else full
    return list(dict.fromkeys([first, full, *own]))


def _candidates(index: int, header: Header) -> Iterator[Candidate]:
    layers: dict[str, set[str]] = {}
    for channel in header["channels"]:
        layer, _, name = channel.name.rpartition(".")
        layers.setdefault(layer, set()).add(name)
    for layer in sorted(layers):
        channels = _picture(layers[layer])
        if channels:
            named = tuple(f"{layer}.{name}" if layer else name for name in channels)
            yield Candidate(index, str(header.get("name", "")), layer, named)


def _picture(names: set[str]) -> tuple[str, ...]:
    """Channels of a layer that form a picture; none if it is depth, motion or the like."""
    if names.issuperset(_RGB):
        return _RGB
    if names.issuperset(_XYZ):
        return _XYZ
    return ("Y",) if "Y" in names and names <= {"Y", "A"} else ()


def _no_picture(headers: Sequence[Header]) -> InputError:
    names = [channel.name for header in headers for channel in header["channels"]]
    last = {name.rpartition(".")[2] for name in names}
    if {"Y", "RY", "BY"} <= last:
        return InputError("holds luminance and chroma (Y, RY, BY)", fix="save it as RGB")
    return InputError(f"has the channels {_listed(names) or 'none'}, no R, G, B and no single Y", fix="save it as RGB")


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more
