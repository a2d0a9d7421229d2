"""What a user should know of a finished bake."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rsibr.store.bake import Bake


def peculiarities(bake: Bake) -> tuple[str, ...]:
    """Notes on the material, effects that were forced off, the environment, and values that were clipped."""
    told = bake.manifest
    notes = [f"{told.material.name}: {text}" for text in told.material.notes]
    notes += told.plan.notes() if told.plan else ()
    environment = told.environment
    if environment.clipped:
        notes.append(
            f"{environment.name}: {environment.clipped} negative values clipped to 0 "
            f"(the lowest was {environment.lowest:.2g})"
        )
    return tuple(notes)


def suspicions(bake: Bake) -> tuple[str, ...]:
    """Note of the number of suspicious texels of each kind, if there are any."""
    records = [state.health for state in bake.manifest.views if state.health is not None]
    counts = {
        "non-finite": sum(record.non_finite for record in records),
        "missing": sum(record.holes for record in records),
        "firefly": sum(record.fireflies for record in records),
        "half-float overflow": sum(record.half_overflow for record in records),
    }
    found = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    return (f"suspicious texels: {found}. `rsibr check {bake.path}` lists them",) if found else ()
