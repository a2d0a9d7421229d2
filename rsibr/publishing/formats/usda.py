"""`usda`: a stage of USD with a DomeLight, as text, and its picture."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import OpenEXR

from rsibr.geometry.projections.latlong import OPENEXR
from rsibr.publishing.exr_bytes import encode_exr
from rsibr.publishing.registry import Encoded, register
from rsibr.publishing.sizes import latlong_rows

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView

_STAGE = """#usda 1.0
(
    defaultPrim = "Dome"
    doc = "{about}"
    metersPerUnit = 1
    upAxis = "Y"
)

def DomeLight "Dome"
{{
    color3f inputs:color = (1, 1, 1)
    bool inputs:enableColorTemperature = 0
    float inputs:exposure = 0
    float inputs:intensity = 1
    asset inputs:texture:file = @./{picture}@
    token inputs:texture:format = "latlong"
}}
"""


@register("usda", summary="USD DomeLight as text, with its picture as OpenEXR", files=("usda", "dome.exr"))
def usda(view: PublishedView, *, size: int | None = None) -> Encoded:
    """Encode the reflection of a view as a dome: what a perfect mirror under it shows in this view.

    Parameters
    ----------
    view : PublishedView
        The view.
    size : int, optional
        Rows of the picture; by default those of the sphere map. Columns are twice as many.
    """
    rows = latlong_rows(size, view.resolution)
    image = view.in_projection(OPENEXR, (rows, 2 * rows))[0]
    about = f"{view.about_directions} A perfect mirror under this dome shows it."
    attributes = {"envmap": OpenEXR.ENVMAP_LATLONG}
    picture, notes = encode_exr(view, {"": image}, about, half=False, attributes=attributes)
    stage = _STAGE.format(about=re.sub(r'["\\]', "'", about), picture=f"{view.stem}.dome.exr")
    return Encoded({"usda": stage.encode(), "dome.exr": picture}, notes)
