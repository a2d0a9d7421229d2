"""Note on the size of a job before it starts, on stderr."""

from __future__ import annotations

from rsibr.cli.console import say
from rsibr.cli.verbosity import is_verbose
from rsibr.job_size import JobSize, in_bytes
from rsibr.validation.report.page import duration


def note_job(job: JobSize) -> None:
    """Print bytes, memory and time of a job, if it is large or `--verbose` is given."""
    if not (job.is_large or is_verbose()):
        return
    parts = [f"{in_bytes(job.disk)} on disk" if job.disk else "", f"{in_bytes(job.memory)} of memory"]
    if job.seconds is not None:
        parts.append(duration(job.seconds))
    say(f"{job.name}: about {', '.join(filter(None, parts))}")
