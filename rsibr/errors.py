"""Exceptions for all failures that a user can cause, with cause, location and remedy.

Any other exception that reaches the user is a bug, and shows its traceback.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class RsibrError(Exception):
    """Failure that the user can fix; printed as one line without a traceback.

    Parameters
    ----------
    what : str
        Cause, with the offending value.
    where : str, optional
        File, config key, option or texel.
    fix : str, optional
        Remedy, as an imperative sentence.
    """

    exit_code = 2

    def __init__(self, what: str, *, where: str = "", fix: str = "") -> None:
        super().__init__(what, where, fix)
        self.what = what
        self.where = where
        self.fix = fix

    def __reduce__(self) -> tuple[object, ...]:
        return _made, (type(self), self.what, self.where, self.fix)  # pickled, so that other processes can raise it

    def __str__(self) -> str:
        """Return the message in one line: location, cause, remedy; see `printable`."""
        place = f"{printable(self.where)}: " if self.where else ""
        remedy = f". {self.fix[:1].upper()}{self.fix[1:]}" if self.fix else ""
        return place + printable(" ".join(f"{self.what}{remedy}".split()))


def printable(text: object) -> str:
    """One line of `text` that a terminal shows as it is: a newline and other unprintable characters are escaped.

    File names may hold newlines and bytes that are no text, and the names in a stranger's bake may hold the control
    sequences of a terminal.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(text))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Begin a remedy with the known name nearest to a misspelt one; empty if none is near."""
    near = get_close_matches(name, list(known), 1)
    return f"did you mean '{near[0]}'? " if near else ""


def _made(kind: type[RsibrError], what: str, where: str, fix: str) -> RsibrError:
    return kind(what, where=where, fix=fix)


class InputError(RsibrError):
    """Invalid input: an argument, a config, an environment, a material (exit code 2)."""

    exit_code = 2


class BakeError(RsibrError):
    """Unusable bake on disk: missing, altered, truncated, locked or of another config (exit code 2)."""

    exit_code = 2


class CheckFailed(RsibrError):  # noqa: N818  # the result of a check, not an error
    """A check was carried out and failed (exit code 1)."""

    exit_code = 1


class MachineError(RsibrError):
    """Missing resource of the machine: libLLVM, a device, memory, disk space (exit code 3)."""

    exit_code = 3
