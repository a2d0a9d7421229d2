"""Progress of a bake or a study."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """Argument of `on_progress` callbacks.

    Attributes
    ----------
    done, total : float
        Work done, and total work: views of a bake, including those of earlier runs, or expected seconds of the steps
        of a study.
    step : str
        Name of the current step.
    share : float
        Completed fraction of that step, in [0, 1], where it is known.
    """

    done: float
    total: float
    step: str
    share: float = 0.0
