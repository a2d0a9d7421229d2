"""Progress of a job, such as a bake or a study."""

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


def as_progress(*state: Progress | float) -> Progress:
    """State of a job from the arguments of its callback: a `Progress`, or the numbers done and in all.

    Examples
    --------
    >>> as_progress(3, 8)
    Progress(done=3, total=8, step='', share=0.0)
    """
    if len(state) == 1 and isinstance(state[0], Progress):
        return state[0]
    done, total = (one for one in state if not isinstance(one, Progress))
    return Progress(done, total, "")


@dataclass(frozen=True)
class Job:
    """What the progress of a job counts.

    Attributes
    ----------
    name : str
        Name of the job, such as "bake".
    unit : str
        What is counted, such as "views"; empty for expected seconds, of which a share is shown.
    has_parts : bool
        Whether the current step reports a share of its own.
    """

    name: str
    unit: str = "steps"
    has_parts: bool = False


BAKE = Job("bake", "views", has_parts=True)
STUDY = Job("study", "")
