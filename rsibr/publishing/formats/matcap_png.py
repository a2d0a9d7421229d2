"""`matcap-png`: sphere map as a matcap picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rsibr.methods.options import number
from rsibr.publishing.png_bytes import encode_picture
from rsibr.publishing.registry import Encoded, register

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("matcap-png", summary="matcap as an 8-bit picture, filled beyond the disk", files=("matcap.png",))
def matcap_png(view: PublishedView, *, exposure: float | None = None) -> Encoded:
    """Encode the sphere map of a view as a matcap: opaque, continued beyond the disk, so that no rim is dark.

    Parameters
    ----------
    view : PublishedView
        The view.
    exposure : float, optional
        Stops; 0: radiance 1 is white. By default the 95th percentile of the disk is bright.
    """
    opaque = np.ones_like(view.coverage)
    stops = None if exposure is None else number("exposure", exposure, most=100.0)
    data = encode_picture(view, view.filled(view.image), opaque, stops)
    return Encoded({"matcap.png": data})
