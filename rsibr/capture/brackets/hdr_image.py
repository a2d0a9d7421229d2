"""Merged photograph: radiance, its variance and what was saturated, in one OpenEXR file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rsibr.capture.exr_parts import read_parts, write_parts
from rsibr.errors import InputError

RADIANCE, VARIANCE, SATURATED = "radiance", "variance", "saturated"
"""Names of the parts."""


@dataclass(frozen=True, eq=False)
class HdrImage:
    """Radiance of a view.

    Attributes
    ----------
    radiance : ndarray, shape (H, W, 3), float32
        Scene-linear; a lower bound where `saturated`.
    variance : ndarray, shape (H, W, 3), float32
        Variance of the radiance by the noise of the camera.
    saturated : ndarray, shape (H, W, 3), bool
        Channels that were saturated in every photograph.
    """

    radiance: NDArray[np.float32]
    variance: NDArray[np.float32]
    saturated: NDArray[np.bool_]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return self.radiance.shape[1], self.radiance.shape[0]

    def write(self, path: Path | str) -> None:
        """Write the parts `radiance`, `variance` and `saturated` into one OpenEXR file, atomically.

        Its picture is the radiance: it can be given as `environment.file`.
        """
        parts = {RADIANCE: self.radiance, VARIANCE: self.variance, SATURATED: self.saturated}
        write_parts(path, parts)


def read_hdr_image(path: Path | str) -> HdrImage:
    """Read a merged photograph.

    Raises
    ------
    InputError
        If the file cannot be read, is none of `rsibr capture hdr`, or its parts differ in size.
    """
    return hdr_image_of(read_parts(Path(path)), str(path))


def hdr_image_of(parts: Mapping[str, NDArray[np.float32]], where: str) -> HdrImage:
    """Merged photograph of the parts of a file; `where` names it in an error.

    Raises
    ------
    InputError
        If parts are missing, or differ in size.
    """
    if not {RADIANCE, VARIANCE, SATURATED} <= set(parts):
        fix = "make it with `rsibr capture hdr`"
        raise InputError(f"has no parts {RADIANCE}, {VARIANCE} and {SATURATED}", where=where, fix=fix)
    radiance, variance, saturated = parts[RADIANCE], parts[VARIANCE], parts[SATURATED]
    if not radiance.shape == variance.shape == saturated.shape:
        raise InputError("its parts differ in size", where=where, fix="merge the photographs again")
    return HdrImage(radiance, variance, saturated > 0.5)
