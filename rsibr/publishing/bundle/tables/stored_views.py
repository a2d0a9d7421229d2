"""Stored views of a bake: directions, triangles, frames, and maps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from rsibr.geometry.projections.sphere_map import stored_coverage
from rsibr.methods.rsibr.residual_method import ResidualOptions
from rsibr.publishing.bundle.contents import Part, Request, contributes
from rsibr.publishing.bundle.encoding import encoded, encoded_images


@contributes("stored", to=("nearest", "blend", "cabral1999", "rsibr"))
def stored_views(request: Request) -> Part:
    """Maps without what lies outside the disk, and where each texel there takes its value from.

    The layer of a delta lobe that is stored by itself is a second set of maps, `mirrored`, since residuals are carried
    without it; `maps` are then the rest.
    """
    inputs = request.methods.inputs
    if not inputs.bake.has_views:
        return Part()  # a map that the closed form of the lobes is checked with
    options = ResidualOptions(inputs)
    apart = options.separate_mirror
    carried = np.stack([_inside(options.carried_image(one), one.coverage) for one in inputs.maps])
    part = Part(
        {
            "resolution": inputs.bake.resolution,
            "views": inputs.bake.view_count,
            "warp": inputs.bake.manifest.material.warp,
        }
    )
    frames = np.stack([one.frame for one in inputs.maps])
    part.arrays = {
        "directions": encoded(inputs.viewpoints.directions.astype(np.float32)),
        "triangles": encoded(inputs.viewpoints.triangles.astype(np.uint32)),
        "frames": encoded(np.swapaxes(frames, 1, 2).astype(np.float32)),
        "filling": encoded(filling(inputs.bake.resolution)),
        "maps": encoded_images(carried, request.precision),
    }
    if apart is not None:
        mirrored = np.stack([_inside(inputs.image(one, apart), one.coverage) for one in inputs.maps])
        part.arrays["mirrored"] = encoded_images(mirrored, request.precision)
    return part


def filling(resolution: int) -> NDArray[np.int16]:
    """Where each texel of a map with a border of one takes its value from, as `filled_outward` extends it.

    Returns
    -------
    ndarray, shape (2, N + 2, N + 2)
        Rows and columns from each texel to the nearest one inside the disk: 0 for texels inside.
    """
    covered = np.pad(stored_coverage(resolution) > 0, 1)
    nearest = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    return np.asarray(nearest - np.indices(covered.shape), dtype=np.int16)


def _inside(image: NDArray[np.float32], coverage: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.where(coverage[..., None] > 0, image, np.float32(0))
