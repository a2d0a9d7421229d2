"""`cube-exr`: six faces of a cube, each an OpenEXR file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsibr.geometry.projections.cube import CUBE
from rsibr.geometry.projections.faces import FACES
from rsibr.methods.options import flag
from rsibr.publishing.cube_levels import CONVENTION
from rsibr.publishing.exr_bytes import encode_exr
from rsibr.publishing.registry import Encoded, register
from rsibr.publishing.sizes import face_texels

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register("cube-exr", summary="six faces of a cube, px to nz, OpenEXR", files=tuple(f"{face}.exr" for face in FACES))
def cube_exr(view: PublishedView, *, size: int | None = None, half: bool = False) -> Encoded:
    """Encode the reflection of a view.

    Parameters
    ----------
    view : PublishedView
        The view.
    size : int, optional
        Texels a side of a face, a power of two; by default about half of the sphere map's.
    half : bool
        float16 and not float32.
    """
    faces = view.in_projection(CUBE, face_texels(size, view.resolution))
    files: dict[str, bytes] = {}
    notes: tuple[str, ...] = ()
    for face, image in zip(FACES, faces, strict=True):
        about = f"{view.about_directions} Face {face}. {CONVENTION}"
        files[f"{face}.exr"], told = encode_exr(view, {"": image}, about, half=flag("half", half))
        notes += tuple(f"{face}: {one}" for one in told)
    return Encoded(files, notes)
