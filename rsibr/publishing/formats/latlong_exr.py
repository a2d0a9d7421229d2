"""`latlong-exr`: reflection of a view by the mirror direction, latitude–longitude, OpenEXR."""

from __future__ import annotations

from typing import TYPE_CHECKING

import OpenEXR

from rsibr.geometry.projections.latlong import OPENEXR
from rsibr.methods.options import flag
from rsibr.publishing.exr_bytes import encode_exr
from rsibr.publishing.latlong_axes import latlong_projection
from rsibr.publishing.registry import Encoded, register
from rsibr.publishing.sizes import latlong_rows

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("latlong-exr", summary="latitude–longitude map, OpenEXR with the attribute envmap", files=("latlong.exr",))
def latlong_exr(
    view: PublishedView, *, size: int | None = None, axes: str = OPENEXR.name, half: bool = False
) -> Encoded:
    """Encode the reflection of a view.

    Parameters
    ----------
    view : PublishedView
        The view.
    size : int, optional
        Rows; by default those of the sphere map. Columns are twice as many.
    axes : str
        Name of a latitude–longitude projection. The default is OpenEXR's own: +Y up, −Z, +X, +Z, −X at u = 0, ¼, ½, ¾,
        the outer texels' centres on the edges; the file then has the attribute `envmap`, and otherwise none.
    half : bool
        float16 and not float32.
    """
    projection = latlong_projection(axes)
    rows = latlong_rows(size, view.resolution)
    image = view.in_projection(projection, (rows, 2 * rows))[0]
    attributes = {"envmap": OpenEXR.ENVMAP_LATLONG} if projection is OPENEXR else {}
    about = f"{view.about_directions} Latitude-longitude, axes: {projection.name}."
    data, notes = encode_exr(view, {"": image}, about, half=flag("half", half), attributes=attributes)
    return Encoded({"latlong.exr": data}, notes)
