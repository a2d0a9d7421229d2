"""Pictures in any projection of the sphere, converted to the latitude–longitude image of Mitsuba's envmap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.errors import InputError
from rsibr.geometry.projections.latlong import MITSUBA, LatLong
from rsibr.geometry.projections.projection import Projection, projection, projection_names
from rsibr.geometry.projections.sheet_layout import layout_of, layouts
from rsibr.geometry.projections.sphere_image import SphereImage, converted

Image = NDArray[np.float32]

KEY = "environment.projection"

_SAMPLES = 2  # a side of a texel, where texels of the two do not coincide: keeps the energy of lone bright ones


def environment_projection(name: str) -> Projection:
    """Projection of an environment by name.

    Raises
    ------
    InputError
        If there is none, or it shows a hemisphere only.
    """
    try:
        found = projection(name)
    except InputError as error:
        raise InputError(error.what, where=KEY, fix=error.fix) from None
    if not found.covers_sphere:
        whole = ", ".join(one for one in projection_names() if projection(one).covers_sphere)
        raise InputError(f"'{name}' shows a hemisphere, not the whole sphere", where=KEY, fix=f"there are: {whole}")
    return found


def sheets_of(image: Image, of: Projection, where: str) -> tuple[Image, str]:
    """Cut a picture into the sheets of a projection, as its aspect ratio tells.

    Parameters
    ----------
    image : ndarray (H, W, 3)
        The picture.
    of : Projection
        Its projection.
    where : str
        File that an error names.

    Returns
    -------
    sheets : ndarray (F, h, w, 3)
        Sheets of the projection.
    layout : str
        Name of the layout.
    """
    height, width = image.shape[:2]
    found = layout_of(of, height, width)
    if found is None:
        shapes = ", ".join(f"{one.across}:{one.down} ({one.name})" for one in layouts(of))
        what = f"its {width} × {height} texels are no '{of.name}'"
        raise InputError(what, where=where, fix=f"save it with square sheets, {shapes}")
    return found.split(image), found.name


def to_latlong(values: Image, of: Projection, most_texels: int, where: str) -> Image:
    """Convert sheets to a latitude–longitude image.

    Parameters
    ----------
    values : ndarray (F, h, w, 3)
        Sheets.
    of : Projection
        Their projection.
    most_texels : int
        Texels at most.
    where : str
        File that an error names.

    Returns
    -------
    ndarray (H, W, 3), float32
        As Mitsuba's envmap, of the size of `Projection.latlong_size`. Between two conventions of latitude and longitude
        the texels stay as they are, and rows come between them; from others each is the mean of 2 × 2 bilinear samples.

    Raises
    ------
    InputError
        If it would have too many texels.
    """
    if of is MITSUBA:
        return np.ascontiguousarray(values[0], dtype=np.float32)
    height, width = of.latlong_size(*values.shape[1:3])
    if height * width > most_texels:
        raise InputError(
            f"the map of {width} × {height} texels that its '{of.name}' needs has more than {most_texels}",
            where=where,
            fix="scale it down",
        )
    backend.use()
    samples = 1 if isinstance(of, LatLong) else _SAMPLES
    latlong = converted(SphereImage(of, values), MITSUBA, (height, width), samples=samples)
    return np.ascontiguousarray(latlong.values[0], dtype=np.float32)
