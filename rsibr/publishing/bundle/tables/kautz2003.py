"""Tables of `kautz2003`: nine coefficients, and the two levels of the filtered cube around the material's own."""

from __future__ import annotations

from typing import Any

import numpy as np

from rsibr.publishing.bundle.contents import Part, Request, contributes
from rsibr.publishing.bundle.encoding import encoded_images
from rsibr.publishing.bundle.tables.device_tables import numbers_of


@contributes("kautz2003", to=("kautz2003",))
def kautz2003(request: Request) -> Part:
    """The level of detail of a point is a constant of the material, so that two levels are all that is read."""
    method: Any = request.methods["kautz2003"]
    mix = method.shading
    cube, (level,) = mix.light.glossy, numbers_of(mix.level)
    starts, sizes = (np.array(one).astype(int) for one in (cube.starts, cube.sizes))
    texels = np.array(cube.texels, np.float32).reshape(-1, 4)[:, :3]
    place = float(np.clip(np.float32(level), 0, len(sizes) - 1))
    below = int(place)
    read = [below, min(below + 1, len(sizes) - 1)]
    part = Part(
        {
            "points": method.points,
            "fLambda": numbers_of(mix.f_lambda),
            "kD": numbers_of(mix.k_d),
            "kS": numbers_of(mix.k_s),
            "harmonics": numbers_of(mix.light.diffuse.factors),
            "shares": [place - below],
        }
    )
    for k, one in enumerate(read):
        side = sizes[one] + 2
        faces = texels[starts[one] : starts[one] + 6 * side * side].reshape(6, side, side, 3)
        part.arrays[f"cube.{k}"] = encoded_images(faces, request.precision)
    return part
