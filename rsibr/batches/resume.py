"""What a directory holds of a batch already: jobs that need not run again, and bakes that stand in the way."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rsibr.batches.job import Job
from rsibr.batches.result import JobResult, read_result
from rsibr.batches.sections import canonical_text

MANIFEST = "manifest.json"
"""File of a bake in its directory, finished or not."""


class DoneJobs:
    """Tells which jobs are done, from their results.

    Parameters
    ----------
    out : Path
        Directory of the batch.
    contents : mapping
        Digests of what the files of environments and materials hold now, see `rsibr.batches.check.check_contents`;
        where they are not known, the results are believed.
    """

    def __init__(self, out: Path, contents: Mapping[str, Mapping[str, str]]) -> None:
        self._out, self._contents = out, contents

    def has(self, job: Job) -> bool:
        """Whether a whole bake and a finished result of exactly this job are there."""
        found = self._result(job)
        return found is not None and found.answers(job) and not self._changed(job, found)

    def obstacle(self, job: Job) -> str:
        """Why the finished bake of this name is not the job's: what differs; empty if none is in the way."""
        found = self._result(job)
        if found is None or found.state != "done":
            return ""
        return "the settings" if found.digest != job.digest else self._changed(job, found)

    def _result(self, job: Job) -> JobResult | None:
        """Result of the name, if its bake is there too."""
        found = read_result(self._out, job.name)
        return found if found is not None and (self._out / job.bake / MANIFEST).is_file() else None

    def _changed(self, job: Job, found: JobResult) -> str:
        """File whose content differs from what was baked; empty if none does."""
        for kind, digest in found.contents.items():
            known = self._contents.get(kind, {}).get(canonical_text(job.settings[kind]), digest)
            if known != digest:
                return f"the content of the {kind}"
        return ""
