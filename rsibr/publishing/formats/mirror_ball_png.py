"""`mirror-ball-png`: the sphere map as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsibr.methods.options import number
from rsibr.publishing.png_bytes import encode_picture
from rsibr.publishing.registry import Encoded, register

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("mirror-ball-png", summary="sphere map as an 8-bit picture, transparent around the disk", files=("ball.png",))
def mirror_ball_png(view: PublishedView, *, exposure: float | None = None) -> Encoded:
    """Encode the sphere map of a view as a picture.

    Parameters
    ----------
    view : PublishedView
        The view.
    exposure : float, optional
        Stops; 0: radiance 1 is white. By default the 95th percentile of the disk is bright.
    """
    stops = None if exposure is None else number("exposure", exposure, most=100.0)
    data = encode_picture(view, view.image, view.coverage, stops)
    return Encoded({"ball.png": data})
