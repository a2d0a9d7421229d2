"""Steps after a bake of a batch: it is validated and published, each into a folder of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rsibr.batches.job import Job
from rsibr.methods.registry import default_method
from rsibr.publishing.publish import publish
from rsibr.store.bake import Bake
from rsibr.validation.results import Validation
from rsibr.validation.validation import validate

REPORTS_NAME = "reports"
PUBLISHED_NAME = "published"
"""Folders of what the steps write, in the directory of a batch."""


def run_steps(job: Job, bake: Bake, out: Path) -> tuple[dict[str, Any], float | None]:
    """Run the steps that a job asks for after its bake.

    Parameters
    ----------
    job : Job
        The job.
    bake : Bake
        Its bake.
    out : Path
        Directory of the batch.

    Returns
    -------
    then : dict
        What each step wrote, relative to `out`; see `rsibr.batches.result.JobResult`.
    error : float or None
        Worst relMSE over the judged views, of the default method; None if it was not judged.

    Raises
    ------
    RsibrError
        If a step fails. The bake is kept.
    """
    then: dict[str, Any] = {}
    error = None
    if job.then.validate is not None:
        folder = Path(REPORTS_NAME, job.name)
        found = validate(bake, **job.then.validate, out=out / folder)
        then["validate"] = {"report": str(folder / "report.html")}
        error = worst_error(found)
    if job.then.publish:
        folder = Path(PUBLISHED_NAME, job.name)
        then["publish"] = {name: _published(bake, name, folder, out) for name in job.then.publish}
    return then, error


def _published(bake: Bake, name: str, folder: Path, out: Path) -> list[str]:
    """Files of one format, of all stored views; those of an earlier attempt are replaced."""
    made = publish(bake, "all", name, out / folder, fresh=True)
    return [str(folder / file.name) for file in made.files]


def worst_error(found: Validation) -> float | None:
    """Worst relMSE of the default method over the judged views; None if another method was judged."""
    name = default_method()
    errors = [view.methods[name].error.rel_mse.value for view in found.views if name in view.methods]
    return max(errors, default=None)
