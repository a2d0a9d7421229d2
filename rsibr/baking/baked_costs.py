"""Measured costs of a finished bake, for its plan."""

from __future__ import annotations

from statistics import median

from rsibr.planning.costs import Costs
from rsibr.store.manifest import Manifest

BAKED = "measured: median seconds and bytes of the maps of this bake; `rsibr plan` measures the missing costs"


def baked_costs(manifest: Manifest, views: int, wall_seconds: float) -> Costs:
    """Costs of a finished bake and of one of its maps.

    Parameters
    ----------
    manifest : Manifest
        Manifest with all views done.
    views : int
        Number of views that the config asks for.
    wall_seconds : float
        Wall time of the bake [s].
    """
    apart = manifest.views[: min((lobe.views or views for lobe in manifest.lobes), default=views)]
    return Costs(
        views=views,
        lobes=max(1, len(manifest.lobes)),
        seconds=median(state.seconds or 0.0 for state in manifest.views),
        bytes=round(median(state.bytes or 0 for state in apart)),
        light_bytes=manifest.light.bytes if manifest.light else 0,
        overhead_seconds=max(0.0, wall_seconds - manifest.seconds),
        source=BAKED,
    )
