"""`rsibr capture hdr`: exposure brackets of one view become radiance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rsibr.capture.brackets.alignment import aligned
from rsibr.capture.brackets.hdr_image import HdrImage
from rsibr.capture.brackets.merge import merged
from rsibr.capture.brackets.noise_model import NoiseModel
from rsibr.capture.curves import debevec
from rsibr.capture.curves.chosen import chosen_curve
from rsibr.capture.curves.curve import Curve
from rsibr.capture.curves.srgb import SRGB
from rsibr.capture.photographs.exposure import Exposure
from rsibr.capture.photographs.photograph import Photograph, read_photograph
from rsibr.errors import InputError


@dataclass(frozen=True, eq=False)
class MergedBrackets:
    """Result of `capture_hdr`.

    Attributes
    ----------
    image : HdrImage
        Radiance, variance and saturation.
    curve : Curve
        The one that was used.
    shifts : dict of str to (int, int)
        Columns and rows by which each photograph was moved; empty if none was aligned.
    left_out : tuple of str
        Photographs that show too little to be aligned.
    """

    image: HdrImage
    curve: Curve
    shifts: dict[str, tuple[int, int]]
    left_out: tuple[str, ...]

    @property
    def saturated_pixels(self) -> int:
        """Pixels with a channel that is a lower bound only."""
        return int(self.image.saturated.any(axis=2).sum())

    @property
    def saturated_box(self) -> tuple[int, int, int, int] | None:
        """First and last column, first and last row of the saturated pixels; None if there are none."""
        rows, columns = np.nonzero(self.image.saturated.any(axis=2))
        if not len(rows):
            return None
        return int(columns.min()), int(columns.max()), int(rows.min()), int(rows.max())


def capture_hdr(
    shots: Sequence[Path | str | Photograph],
    *,
    curve: str | Path | Curve = "srgb",
    exposures: Sequence[float | Exposure] = (),
    noise: NoiseModel | None = None,
    align: bool = True,
) -> MergedBrackets:
    """Merge exposure brackets into radiance.

    Parameters
    ----------
    shots : sequence of path or Photograph
        Photographs of one view; PNG, JPEG, TIFF, EXR or raw.
    curve : str, path or Curve
        `srgb`, `linear`, `debevec` (calibrated from the shots), a CSV file, or a curve.
    exposures : sequence of float or Exposure
        One for each shot, in seconds; by default what EXIF says.
    noise : NoiseModel, optional
        Of the camera.
    align : bool
        Whether the shots are shifted onto each other.

    Returns
    -------
    MergedBrackets

    Raises
    ------
    InputError
        If a shot cannot be read, an exposure is unknown, or the curve is.
    MachineError
        If the package OpenCV is not installed.
    """
    photographs = _exposed([_photograph(one) for one in shots], exposures)
    shifts: dict[str, tuple[int, int]] = {}
    left_out: tuple[str, ...] = ()
    if align and len(photographs) > 1:
        found = aligned(photographs, SRGB if curve == debevec.NAME else chosen_curve(curve))
        photographs, shifts, left_out = list(found.photographs), found.shifts, found.left_out
    chosen = _curve(curve, photographs)
    return MergedBrackets(merged(photographs, chosen, noise), chosen, shifts, left_out)


def _photograph(shot: Path | str | Photograph) -> Photograph:
    return shot if isinstance(shot, Photograph) else read_photograph(shot)


def _exposed(photographs: list[Photograph], exposures: Sequence[float | Exposure]) -> list[Photograph]:
    if not exposures:
        return photographs
    if len(exposures) != len(photographs):
        what = f"{len(exposures)} exposures for {len(photographs)} photographs"
        raise InputError(what, where="exposures", fix="give one for each, in the same order")
    known = [one if isinstance(one, Exposure) else Exposure(float(one)) for one in exposures]
    return [photograph.exposed(exposure) for photograph, exposure in zip(photographs, known, strict=True)]


def _curve(curve: str | Path | Curve, photographs: Sequence[Photograph]) -> Curve:
    return debevec.calibrated(_shared(photographs)) if curve == debevec.NAME else chosen_curve(curve)


def _shared(photographs: Sequence[Photograph]) -> list[Photograph]:
    """Photographs, cut to what all of them show once they are aligned."""
    seen = np.all([np.isfinite(one.values).all(axis=2) for one in photographs], axis=0)
    rows, columns = seen.any(axis=1), seen.any(axis=0)
    if not rows.any():
        fix = "leave out those of another view, or use --no-align"
        raise InputError("the photographs share nothing", where="shots", fix=fix)
    return [replace(one, values=np.ascontiguousarray(one.values[rows][:, columns])) for one in photographs]
