"""Names of jobs: a pattern with `{key}` in it, and what makes a name a safe path on every machine."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import lru_cache

from rsibr.batches.job import BAKE_SUFFIX, RESULTS_NAME
from rsibr.errors import InputError, did_you_mean

_FIELD = re.compile(r"\{([^{}]*)\}")

RESERVED = (RESULTS_NAME, "lights", "reports", "published")
"""Folders in the directory of a batch that are no job's."""

_SUFFIXES = (BAKE_SUFFIX, ".json")
_LONGEST_PART, _LONGEST_NAME = 200, 1000
"""Bytes of a part of a name, and of the whole: file systems end names at 255 bytes, and paths at some 4096."""


@dataclass(frozen=True)
class NamePattern:
    """Pattern of the names of jobs.

    Attributes
    ----------
    text : str
        Text with `{key}` in place of the value of a key of the config.
    keys : tuple of str
        Keys in it, each once.

    Examples
    --------
    >>> pattern = NamePattern.of("{material}/{map.resolution}", ["material", "map.resolution"], "batch")
    >>> pattern.filled({"material": "solid-red", "map.resolution": "256"}.__getitem__)
    'solid-red/256'
    """

    text: str
    keys: tuple[str, ...]
    _pieces: tuple[str, ...] = field(repr=False)

    @classmethod
    def of(cls, text: str, known: Iterable[str], where: str) -> NamePattern:
        """Read a pattern; `known` are the keys that may stand in it.

        Raises
        ------
        InputError
            If a key is unknown, or a brace has no partner.
        """
        names = list(known)
        pieces = tuple(_FIELD.split(text))
        if any("{" in piece or "}" in piece for piece in pieces[::2]):
            raise InputError(f"name = '{text}' has a brace without its partner", where=where)
        for key in pieces[1::2]:
            if key not in names:
                fix = did_you_mean(key, names) or f"keys of the matrix are {', '.join(names)}"
                raise InputError(f"name = '{text}': there is no key '{key}'", where=where, fix=fix.strip())
        return cls(text, tuple(dict.fromkeys(pieces[1::2])), pieces)

    def filled(self, label: Callable[[str], str]) -> str:
        """Name with `label(key)` in place of each key."""
        return "".join(label(piece) if odd % 2 else piece for odd, piece in enumerate(self._pieces))


def fault_of(name: str) -> str:
    """Why a name is no safe path; empty if it is one."""
    if not name:
        return "is empty"
    if name.startswith("/") or "\\" in name:
        return "should be a relative path with / between its parts"
    if not name.isprintable():
        return "holds control characters"
    if len(name.encode(errors="surrogatepass")) > _LONGEST_NAME:
        return f"is longer than {_LONGEST_NAME} bytes"
    parts = name.split("/")
    if parts[0].casefold() in RESERVED:
        return f"begins with {parts[0]}/, a folder of the batch itself" if len(parts) > 1 else ""
    return next(filter(None, map(_fault_of_part, parts)), "")


@lru_cache(2**12)
def _fault_of_part(part: str) -> str:
    if not part:
        return "has an empty part"
    if part.startswith("."):
        return f"has the part '{part}': none may begin with a dot"
    if part != part.strip():
        return f"has a part that begins or ends with a space: '{part}'"
    if part.casefold().endswith(_SUFFIXES):
        return f"has the part '{part}': none may end with {' or '.join(_SUFFIXES)}"
    if len(part.encode(errors="surrogatepass")) > _LONGEST_PART:
        return f"has a part longer than {_LONGEST_PART} bytes"
    return ""


class NameRegister:
    """Names that were given, and the folders that they lie in; two that a file system may confuse are one."""

    def __init__(self) -> None:
        self._names: set[str] = set()
        self._folders: set[str] = set()

    def clash(self, name: str) -> str:
        """Enter a name; say what it clashes with, or nothing."""
        folded = (name if name.isascii() else unicodedata.normalize("NFC", name)).casefold()
        if folded in self._names:
            return f"two jobs are called '{name}'"
        self._names.add(folded)
        folder = folded.rpartition("/")[0]
        while folder and folder not in self._folders:
            self._folders.add(folder)
            folder = folder.rpartition("/")[0]
        return ""

    def folder_clash(self) -> str:
        """Name of a job that is also the folder of others; empty if there is none."""
        return min(self._names & self._folders, default="")
