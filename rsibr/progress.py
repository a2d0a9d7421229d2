"""How far a long piece of work has come: of a bake and of a study alike."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """State of the work, as `on_progress` is told.

    Attributes
    ----------
    done, total : float
        Work done so far and in all: views of a bake, those done before this run among them; expected seconds of the
        steps of a study.
    step : str
        What is at work.
    share : float
        Share of that step that is done, where it is known.
    """

    done: float
    total: float
    step: str
    share: float = 0.0
