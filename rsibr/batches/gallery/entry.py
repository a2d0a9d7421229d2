"""One job of a batch, as its gallery shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class GalleryEntry:
    """One job of a batch.

    Attributes
    ----------
    name : str
        Name of the job.
    values : mapping of str to any
        Value of each matrix key, as a person wrote it, in the order of the matrix.
    picture : ndarray, shape (H, W, 3), or None
        Linear radiance [W sr⁻¹ m⁻²] of one view; see `rsibr.batches.gallery.thumbnail`. None if there is none.
    error : float or None
        Largest relMSE of the validation; None if it was not validated.
    seconds : float or None
        Wall time of the job [s].
    bytes : int or None
        Size of the bake on disk.
    report : str or None
        Path of the job's report, relative to the gallery.
    reason : str or None
        Why the job failed; None if it is done.
    """

    name: str
    values: Mapping[str, Any] = field(default_factory=dict)
    picture: NDArray[np.floating] | None = None
    error: float | None = None
    seconds: float | None = None
    bytes: int | None = None
    report: str | None = None
    reason: str | None = None

    @property
    def failed(self) -> bool:
        """Whether the job failed."""
        return self.reason is not None

    @property
    def link(self) -> str | None:
        """The report as a relative URL: no path can be taken for a scheme, a query or a fragment."""
        return None if self.report is None else "./" + quote(self.report)
