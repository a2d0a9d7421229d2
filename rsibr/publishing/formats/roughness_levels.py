"""`roughness-levels`: cube of the light whose MIP levels are prefiltered for rising roughness, as engines light by."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from rsibr.errors import InputError
from rsibr.methods.options import power_of_two
from rsibr.methods.split_sum.prefiltered_cube import SHARP, SMALLEST, Sources, lobe_cube, mip_sizes, roughness_of_level
from rsibr.publishing.cube_levels import CONVENTION, CubeLevels
from rsibr.publishing.dds_bytes import encode_dds
from rsibr.publishing.ktx2_bytes import encode_ktx2
from rsibr.publishing.published_view import MAKER
from rsibr.publishing.registry import Encoded, register
from rsibr.publishing.sizes import MOST_FACE

if TYPE_CHECKING:
    from rsibr.publishing.published_view import PublishedLight

_LEAST = 2 * SMALLEST
_KERNEL = "GGX with n = v = r, half vectors drawn from D, light weighted by n.l (Karis 2013)"


@register(
    "roughness-levels",
    summary="light prefiltered by roughness in MIP levels, KTX 2.0 and DDS, roughness of each level in JSON",
    files=("light.ktx2", "light.dds", "light.json"),
    of="light",
)
def roughness_levels(light: PublishedLight, *, size: int = SHARP) -> Encoded:
    """Encode the light of a bake; the levels are those of the method `split-sum` with the option `chain`.

    Parameters
    ----------
    light : PublishedLight
        The light.
    size : int
        Texels a side of a face of the largest level, a power of two from 32.
    """
    sizes = mip_sizes(_at_least_two_levels(power_of_two("size", size, MOST_FACE)))
    alphas = [roughness_of_level(level, len(sizes)) for level in range(len(sizes))]
    sources = Sources.of(light.light)
    cube = CubeLevels.of([lobe_cube(sources, alpha, side) for alpha, side in zip(alphas, sizes, strict=True)])
    delta = len(light.light.delta)
    notes = (*cube.notes, *([f"{delta} lights without extent are not in it"] if delta else []))
    levels = [
        {"level": level, "size": side, "alpha": alpha, "perceptual_roughness": alpha**0.5}
        for level, (side, alpha) in enumerate(zip(sizes, alphas, strict=True))
    ]
    about = {"schema": 1, "about": light.about, "convention": CONVENTION, "kernel": _KERNEL, "writer": MAKER}
    document = json.dumps(about | {"levels": levels, "notes": notes}, indent=1) + "\n"
    words = f"{light.about} MIP levels are roughness levels, see light.json. {CONVENTION}"
    files = {"light.ktx2": encode_ktx2(cube, words), "light.dds": encode_dds(cube), "light.json": document.encode()}
    return Encoded(files, notes)


def _at_least_two_levels(size: int) -> int:
    if size < _LEAST:
        raise InputError(f"{size} texels hold one level", where="option size", fix=f"give at least {_LEAST}")
    return size
