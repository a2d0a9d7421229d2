"""Check of a bake without rendering: each map, all maps jointly, and lookups near singularities."""

from __future__ import annotations

from pathlib import Path

from rsibr import backend
from rsibr.store.bake import Bake, open_bake
from rsibr.validation.health.health import Health, assess
from rsibr.validation.health.health_report import write_health
from rsibr.validation.validation import DEFAULT_VIEWS, novel_views


@backend.in_session
def check(bake: Bake | Path | str, *, out: Path | str | None = None) -> Health:
    """Check a bake for NaN, holes, fireflies, energy drift and half-float overflow.

    Parameters
    ----------
    bake : Bake or path
        A finished bake.
    out : path, optional
        Directory for `health.html`, `health.json` and the pictures.

    Returns
    -------
    Health
        Findings; `trusted` is false if a texel is NaN, Inf or missing.

    Raises
    ------
    BakeError
        If the bake cannot be read, or `out` cannot be written.
    MachineError
        If the machine has no usable backend.

    Examples
    --------
    >>> health = rsibr.check("out/paint.rsibr")       # doctest: +SKIP
    >>> health.trusted, health.warnings               # doctest: +SKIP
    (True, 0)
    """
    opened = open_bake(bake.path if isinstance(bake, Bake) else Path(bake), rehash=True)
    if opened.manifest.light is not None:
        _ = opened.light  # a light that cannot be decoded is an error, as a map is
    health = assess(opened, [view for _, view in novel_views(opened, DEFAULT_VIEWS)])
    if out is not None:
        write_health(health, Path(out))
    return health
