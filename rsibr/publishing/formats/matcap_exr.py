"""`matcap-exr`: sphere map in the passes `diffuse` and `specular`, multilayer OpenEXR, as Blender's matcaps are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsibr.errors import InputError
from rsibr.methods.options import flag
from rsibr.publishing.exr_bytes import encode_exr
from rsibr.publishing.published_view import DIFFUSE, SPECULAR
from rsibr.publishing.registry import Encoded, register

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedView


@register(
    "matcap-exr",
    summary="matcap with the passes diffuse and specular, multilayer OpenEXR",
    files=("matcap.exr",),
    passes=True,
)
def matcap_exr(view: PublishedView, *, half: bool = False) -> Encoded:
    """Encode the sphere map of a view in two passes, channels `diffuse.R` … `specular.B`.

    Parameters
    ----------
    view : PublishedView
        The view, with its passes.
    half : bool
        float16 and not float32.

    Raises
    ------
    InputError
        If its lobes are not known apart.
    """
    if not view.passes:
        fix = 'use mirror-ball-exr or matcap-png, another --method, or bake with effects.lobes = "auto"'
        raise InputError(f"{view.source} does not know the lobes apart", where="format matcap-exr", fix=fix)
    about = f"{view.about} Matcap by the normal in the view's frame (x right, y up); the passes add up."
    passes = {name: view.filled(view.passes[name]) for name in (DIFFUSE, SPECULAR)}
    data, notes = encode_exr(view, passes, about, half=flag("half", half))
    return Encoded({"matcap.exr": data}, notes)
