"""`dds`: cube with MIP levels, DDS with a DX10 header, float16."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsibr.publishing.cube_levels import CONVENTION, CubeLevels
from rsibr.publishing.dds_bytes import encode_dds
from rsibr.publishing.registry import Encoded, register
from rsibr.publishing.sizes import face_texels

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("dds", summary="cube with MIP levels, DDS (DX10) in float16", files=("dds", "dds.txt"))
def dds(view: PublishedView, *, size: int | None = None) -> Encoded:
    """Encode the reflection of a view; a text file beside it says what it holds, as the format has no place for it.

    Parameters
    ----------
    view : PublishedView
        The view.
    size : int, optional
        Texels a side of a face, a power of two; by default about half of the sphere map's.
    """
    cube = CubeLevels.of_view(view, face_texels(size, view.resolution))
    about = "\n".join([view.about_directions, CONVENTION, *cube.notes])
    return Encoded({"dds": encode_dds(cube), "dds.txt": f"{about}\n".encode()}, cube.notes)
