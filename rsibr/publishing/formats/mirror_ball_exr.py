"""`mirror-ball-exr`: the sphere map as it is, OpenEXR."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsibr.methods.options import flag
from rsibr.publishing.exr_bytes import encode_exr
from rsibr.publishing.registry import Encoded, register

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("mirror-ball-exr", summary="sphere map, which is also a mirror ball, OpenEXR", files=("ball.exr",))
def mirror_ball_exr(view: PublishedView, *, half: bool = False) -> Encoded:
    """Encode the sphere map of a view: an orthographic picture of a sphere, x right, y up.

    As a sphere map it is indexed by the normal, as a mirror ball by the mirror direction; both in the view's frame.
    Texels outside the disk continue those inside.

    Parameters
    ----------
    view : PublishedView
        The view.
    half : bool
        float16 and not float32.
    """
    about = f"{view.about} Orthographic picture of the sphere in the view's frame, by the normal (x right, y up)."
    data, notes = encode_exr(view, {"": view.filled(view.image)}, about, half=flag("half", half))
    return Encoded({"ball.exr": data}, notes)
