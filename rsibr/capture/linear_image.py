"""Scene-linear picture of whatever a user has: a merged bracket, a linear file, or a single photograph."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsibr.capture.brackets.hdr_image import SATURATED, HdrImage, hdr_image_of
from rsibr.capture.brackets.merge import SATURATION
from rsibr.capture.curves.chosen import chosen_curve
from rsibr.capture.curves.curve import Curve
from rsibr.capture.exr_parts import part_names, read_parts
from rsibr.capture.photographs.photograph import read_photograph


def linear_image(path: Path | str, curve: str | Path | Curve = "srgb") -> HdrImage:
    """Read a picture as radiance.

    Parameters
    ----------
    path : path
        Result of `rsibr capture hdr`; OpenEXR, Radiance HDR or raw, which are linear; or PNG, JPEG, TIFF.
    curve : str, path or Curve
        Of PNG, JPEG and TIFF: `srgb`, `linear`, a CSV file, or a curve.

    Returns
    -------
    HdrImage
        Of a single photograph the radiance is relative to saturation, the variance is unknown and 0, and what is
        saturated is marked.

    Raises
    ------
    InputError
        If the file cannot be read, or the curve is unknown.
    """
    if Path(path).suffix.lower() == ".exr" and SATURATED in part_names(Path(path)):
        return hdr_image_of(read_parts(Path(path)), str(path))
    photograph = read_photograph(path)
    nothing = np.zeros_like(photograph.values)
    if photograph.is_linear:
        saturated = photograph.values >= 1 if photograph.levels else nothing > 0
        return HdrImage(photograph.values, nothing, saturated)
    radiance = chosen_curve(curve).linear(photograph.values).astype(np.float32)
    return HdrImage(radiance, nothing, photograph.values >= SATURATION)
