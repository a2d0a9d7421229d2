"""`latlong-hdr`: reflection of a view by the mirror direction, latitude–longitude, Radiance RGBE."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsibr.geometry.projections.latlong import THREE
from rsibr.publishing.latlong_axes import latlong_projection
from rsibr.publishing.radiance_bytes import encode_radiance
from rsibr.publishing.registry import Encoded, register
from rsibr.publishing.sizes import latlong_rows

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("latlong-hdr", summary="latitude–longitude map, Radiance .hdr", files=("latlong.hdr",))
def latlong_hdr(view: PublishedView, *, size: int | None = None, axes: str = THREE.name) -> Encoded:
    """Encode the reflection of a view.

    Parameters
    ----------
    view : PublishedView
        The view.
    size : int, optional
        Rows; by default those of the sphere map. Columns are twice as many.
    axes : str
        Name of a latitude–longitude projection. The default is that of three.js, Babylon.js, glTF viewers and Blender:
        +Y up, −X, −Z, +X, +Z at u = 0, ¼, ½, ¾, texels centred.
    """
    projection = latlong_projection(axes)
    rows = latlong_rows(size, view.resolution)
    image = view.in_projection(projection, (rows, 2 * rows))[0]
    data, notes = encode_radiance(image, f"{view.about_directions} Latitude-longitude, axes: {projection.name}.")
    return Encoded({"latlong.hdr": data}, notes)
