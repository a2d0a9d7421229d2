"""Lobes in one channel, as those of a bake whose `effects.colour` is off: the red one stands for all."""

from __future__ import annotations

from typing import Any

from rsibr.store.manifest import LobeRecord


def in_one_channel(lobe: LobeRecord) -> LobeRecord:
    """Return a lobe with the red channel of all its colours in all three.

    Examples
    --------
    >>> in_one_channel(LobeRecord(name="matte", alpha=1.0, albedo=((0.5, 0.2, 0.1),))).albedo
    ((0.5, 0.5, 0.5),)
    """
    return LobeRecord.model_validate(_grey(lobe.model_dump()))


def _grey(value: Any) -> Any:
    """Replace every colour, three numbers in a row, by its first."""
    if isinstance(value, dict):
        return {key: _grey(item) for key, item in value.items()}
    if not isinstance(value, tuple | list):
        return value
    is_colour = len(value) == 3 and all(isinstance(item, float) for item in value)
    return (value[0],) * 3 if is_colour else tuple(_grey(item) for item in value)
