"""Every failure that a user can cause: what went wrong, where, and what to do about it.

Anything else that escapes is a bug of ours and may show its traceback.
"""

from __future__ import annotations


class RsibrError(Exception):
    """A failure that the user can act on; printed as one line, never as a traceback.

    Parameters
    ----------
    what : str
        What is wrong, with the offending value.
    where : str, optional
        File, config key, option or texel that it was found in.
    fix : str, optional
        What to do about it: an imperative sentence.
    """

    exit_code = 2

    def __init__(self, what: str, *, where: str = "", fix: str = "") -> None:
        super().__init__(what, where, fix)
        self.what = what
        self.where = where
        self.fix = fix

    def __reduce__(self) -> tuple[object, ...]:
        return _made, (type(self), self.what, self.where, self.fix)  # other processes raise it, too

    def __str__(self) -> str:
        """Return the one line that a user reads."""
        place = f"{self.where}: " if self.where else ""
        remedy = f". {self.fix[:1].upper()}{self.fix[1:]}" if self.fix else ""
        return " ".join(f"{place}{self.what}{remedy}".split())


def _made(kind: type[RsibrError], what: str, where: str, fix: str) -> RsibrError:
    return kind(what, where=where, fix=fix)


class InputError(RsibrError):
    """The user's input is wrong: an argument, a config, an environment, a material (exit code 2)."""

    exit_code = 2


class BakeError(RsibrError):
    """A bake on disk cannot be used: missing, altered, truncated, locked or of another config (exit code 2)."""

    exit_code = 2


class CheckFailed(RsibrError):  # noqa: N818  # it is a verdict, not an error
    """The work was done and its result does not hold (exit code 1)."""

    exit_code = 1


class MachineError(RsibrError):
    """The machine lacks something: libLLVM, a device, memory, disk space (exit code 3)."""

    exit_code = 3
