"""`ktx2`: cube with MIP levels, KTX 2.0, float16."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsibr.publishing.cube_levels import CONVENTION, CubeLevels
from rsibr.publishing.ktx2_bytes import encode_ktx2
from rsibr.publishing.registry import Encoded, register
from rsibr.publishing.sizes import face_texels

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("ktx2", summary="cube with MIP levels, KTX 2.0 in float16", files=("ktx2",))
def ktx2(view: PublishedView, *, size: int | None = None) -> Encoded:
    """Encode the reflection of a view; the key `rsibr` of the file's data says what it holds.

    Parameters
    ----------
    view : PublishedView
        The view.
    size : int, optional
        Texels a side of a face, a power of two; by default about half of the sphere map's.
    """
    cube = CubeLevels.of_view(view, face_texels(size, view.resolution))
    about = " ".join([view.about_directions, CONVENTION, *cube.notes])
    return Encoded({"ktx2": encode_ktx2(cube, about)}, cube.notes)
