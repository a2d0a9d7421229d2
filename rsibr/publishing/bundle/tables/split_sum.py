"""Tables of `split-sum`: prefiltered cubes with their albedos, irradiance, and the reflections of delta lights."""

from __future__ import annotations

from typing import Any

import numpy as np

from rsibr.publishing.bundle.contents import Part, Request, contributes
from rsibr.publishing.bundle.encoding import encoded, encoded_images
from rsibr.publishing.bundle.tables.device_tables import numbers_of, sheets_of, table_of


@contributes("split-sum", to=("split-sum",))
def split_sum(request: Request) -> Part:
    """Two cubes a glossy lobe, between which it is looked up; without a chain of levels the same one twice."""
    method: Any = request.methods["split-sum"]
    shading = method.shading
    cubes = [lobe.cube for lobe in shading.glossy]
    part = Part(
        {
            "points": method.points,
            "harmonics": numbers_of(shading.irradiance.factors),
            "shares": [0.0 if cube.share is None else numbers_of(cube.share)[0] for cube in cubes],
            "glossy": len(cubes),
        },
        {"diffuse": table_of(shading.diffuse)},
    )
    for k, lobe in enumerate(shading.glossy):
        part.arrays[f"albedo.{k}"] = table_of(lobe.albedo)
        part.arrays[f"cube.{2 * k}"] = encoded_images(sheets_of(lobe.cube.lower), request.precision)
        if lobe.cube.share is not None:
            part.arrays[f"cube.{2 * k + 1}"] = encoded_images(sheets_of(lobe.cube.upper), request.precision)
    if shading.highlights is not None:
        _add_highlights(part, shading.highlights)
    return part


def _add_highlights(part: Part, highlights: Any) -> None:
    """Delta lights, and α, F₀ and F₉₀ of each lobe that reflects them."""
    packets = np.array(highlights.lights.packets, np.float32).reshape(-1, 2, 4)
    lobes = [[*numbers_of(alpha) * 3, *numbers_of(f0), *numbers_of(f90)] for alpha, f0, f90 in highlights.lobes]
    part.arrays["lights"] = encoded(np.ascontiguousarray(packets[..., :3]))
    part.meta["lobes"] = lobes
