"""What a user should know of a finished bake."""

from __future__ import annotations

from pathlib import Path

from rsibr.store.manifest import Manifest


def peculiarities(told: Manifest) -> tuple[str, ...]:
    """Notes on the material, effects that were forced off, the environment, and values that were clipped."""
    notes = [f"{told.material.name}: {text}" for text in told.material.notes]
    notes += told.plan.notes() if told.plan else ()
    environment = told.environment
    if environment.clipped:
        notes.append(
            f"{environment.name}: {environment.clipped} negative values clipped to 0 "
            f"(the lowest was {environment.lowest:.2g})"
        )
    return tuple(notes)


def suspicions(told: Manifest, path: Path) -> tuple[str, ...]:
    """Note of the number of suspicious texels of each kind, if there are any."""
    records = [state.health for state in told.views if state.health is not None]
    counts = {
        "non-finite": sum(record.non_finite for record in records),
        "missing": sum(record.holes for record in records),
        "firefly": sum(record.fireflies for record in records),
        "half-float overflow": sum(record.half_overflow for record in records),
    }
    found = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    return (f"suspicious texels: {found}. `rsibr check {path}` lists them",) if found else ()
