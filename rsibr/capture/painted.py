"""`rsibr capture painted`: a picture of low dynamic range becomes an environment."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsibr import backend
from rsibr.capture.brackets.merge import SATURATION
from rsibr.capture.curves.chosen import chosen_curve
from rsibr.capture.curves.curve import Curve
from rsibr.capture.panorama import LEAST_HEIGHT, Panorama, as_latlong
from rsibr.capture.photographs.photograph import read_photograph
from rsibr.errors import InputError
from rsibr.geometry.projections.sphere_image import SphereImage
from rsibr.scene.panorama.layout import aspect_notes
from rsibr.scene.panorama.resampled import environment_projection, sheets_of

_DEFAULT = "latlong"
_LEAST_SCALE, _MOST_SCALE = 1e-30, 1e30  # float32 holds them with room to spare


@backend.in_session
def capture_painted(
    picture: Path | str,
    *,
    scale: float,
    curve: str | Path | Curve = "srgb",
    projection: str = _DEFAULT,
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
        If the picture cannot be read, is linear, or does not have the shape of its projection; if the scale is out of
        range.
    """
    if not _LEAST_SCALE <= scale <= _MOST_SCALE:
        fix = f"give the radiance of white, {_LEAST_SCALE:g} to {_MOST_SCALE:g}"
        raise InputError(f"a scale of {scale:g}", where="scale", fix=fix)
    image = read_photograph(picture)
    if image.is_linear:
        fix = "use it as environment.file, with environment.scale"
        raise InputError("is no picture of low dynamic range", where=str(picture), fix=fix)
    radiance = (chosen_curve(curve).linear(image.values) * scale).astype(np.float32)
    of = environment_projection(projection)
    sheets, _ = sheets_of(radiance, of, str(picture))
    rows = height or max(of.latlong_size(*sheets.shape[1:3])[0], LEAST_HEIGHT)
    name = curve.name if isinstance(curve, Curve) else str(curve)
    source = f"painted: {Path(picture).name} by the curve {name}, white is {scale:g}"
    notes = list(aspect_notes(*radiance.shape[:2])) if projection == _DEFAULT else []
    white = (image.values >= SATURATION).any(axis=2)
    if white.any():
        share = float(white.mean())
        notes.append(f"{share:.1%} of its pixels are white: what is brighter than {scale:g} is not in it")
    return Panorama(as_latlong(SphereImage(of, sheets), rows), source, tuple(notes))
