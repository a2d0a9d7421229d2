"""Size of a job before it starts: disk, memory and time, held against what the machine has free."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rsibr import machine
from rsibr.errors import InputError

LARGE_BYTES = 2**28
"""Bytes on disk from which a job is large."""
LARGE_MEMORY = 2**30
"""Bytes of memory from which a job is large."""
LARGE_SECONDS = 60.0
"""Expected time from which a job is large [s]."""


@dataclass(frozen=True)
class JobSize:
    """Forecast of what a job takes, from here to its end.

    Attributes
    ----------
    name : str
        What is to be done, for example `"bake of 12 views of 256²"`.
    disk : int
        Bytes that it adds to the disk.
    memory : int
        Bytes of memory at its peak, beyond those that the process has in use already.
    seconds : float or None
        Wall time [s]; None if it was not forecast.
    """

    name: str
    disk: int = 0
    memory: int = 0
    seconds: float | None = None

    @property
    def is_large(self) -> bool:
        """Whether a user should know before it starts."""
        return self.disk >= LARGE_BYTES or self.memory >= LARGE_MEMORY or (self.seconds or 0.0) >= LARGE_SECONDS

    def admit(self, out: Path | str | None, allow_large: bool) -> None:
        """Refuse the job if it exceeds the free memory, or the free disk space at `out`.

        Parameters
        ----------
        out : path or None
            File or directory to write, which need not exist; None if nothing is written.
        allow_large : bool
            Start it all the same.

        Raises
        ------
        InputError
            If it exceeds one of them; the message has what is needed and what is free.
        """
        if allow_large:
            return
        memory, excess = machine.memory().available, []
        if out is not None and self.disk > (free := machine.free_disk(Path(out))):
            excess.append(f"{in_bytes(self.disk)} on disk, and {in_bytes(free)} are free at {out}")
        if memory is not None and self.memory > memory:
            excess.append(f"{in_bytes(self.memory)} of memory, and {in_bytes(memory)} are free")
        if excess:
            raise InputError(
                f"a {self.name} takes about {'; and '.join(excess)}",
                where="allow_large",
                fix="lower resolution, views or samples, make space, or set this to start all the same",
            )


def in_bytes(count: int) -> str:
    """Format a number of bytes: `512 KiB`, `3.2 GiB`."""
    value, unit = float(count), "B"
    for larger in ("KiB", "MiB", "GiB", "TiB"):
        if value < 1024:
            break
        value, unit = value / 1024, larger
    return f"{value:.3g} {unit}" if value < 1000 else f"{value:.0f} {unit}"
