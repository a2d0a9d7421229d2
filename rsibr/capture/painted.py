"""`rsibr capture painted`: a picture of low dynamic range becomes an environment."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsibr import backend
from rsibr.capture.curves.curve import Curve
from rsibr.capture.linear_image import linear_image
from rsibr.capture.panorama import Panorama, as_latlong
from rsibr.errors import InputError
from rsibr.geometry.projections.sphere_image import SphereImage
from rsibr.scene.panorama.resampled import environment_projection, sheets_of


@backend.in_session
def capture_painted(
    picture: Path | str,
    *,
    scale: float,
    curve: str | Path | Curve = "srgb",
    projection: str = "latlong",
    height: int | None = None,
) -> Panorama:
    """Make an environment of a painted picture, or of any other of low dynamic range.

    Parameters
    ----------
    picture : path
        PNG, JPEG or TIFF.
    scale : float
        Radiance of white [W sr⁻¹ m⁻²]: nobody measured it.
    curve : str, path or Curve
        What the values of the picture mean.
    projection : str
        Of the picture, as for `environment.projection`.
    height : int, optional
        Rows of the map; by default those that the picture calls for.

    Raises
    ------
    InputError
        If the picture cannot be read, or does not have the shape of its projection.
    """
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"a scale of {scale:g}", where="scale", fix="give the radiance of white, above 0")
    image = linear_image(picture, curve)
    of = environment_projection(projection)
    sheets, _ = sheets_of(image.radiance * np.float32(scale), of, str(picture))
    rows = height or of.latlong_size(*sheets.shape[1:3])[0]
    name = curve.name if isinstance(curve, Curve) else str(curve)
    source = f"painted: {Path(picture).name} by the curve {name}, white is {scale:g}"
    notes = []
    if image.saturated.any():
        share = float(image.saturated.any(axis=2).mean())
        notes.append(f"{share:.1%} of its pixels are white: what is brighter than {scale:g} is not in it")
    return Panorama(as_latlong(SphereImage(of, sheets), rows), source, tuple(notes))
