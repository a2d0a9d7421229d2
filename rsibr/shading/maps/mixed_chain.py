"""The paper's mixed chain: a map of all normals, each in the place of the mirror direction that points the same way.

Cabral et al. (1999), section 3.3: p_d = g_mirror⁻¹ ∘ T_d⁻¹ ∘ T_s ∘ g_normal (p_s).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.geometry.projections.sphere_map import (
    covered_middle,
    disk_from_reflection,
    reflection_from_disk,
    texel_centre,
    tiled_texels,
)
from rsibr.methods.map_texels import as_rgba, frame_from, laid_out, touches_disk, view_of
from rsibr.methods.protocol import Method
from rsibr.shading.maps.indexing import Indexing
from rsibr.shading.surfaces import LEAST_COSINE, above_horizon

BY_NORMAL_OF_ALL = Indexing(lambda n, _: n, disk_from_reflection)
"""By the normal in a map of the mixed chain: none is beyond its rim."""


class MixedChain:
    """Method whose maps hold all normals instead of those that face the view.

    A plain map ends at the normals on the horizon of its view; under perspective some surfaces show others. What
    depends on the normal alone is exact here. Normals that face away from the view are seen from their own horizon.

    Parameters
    ----------
    method : Method
        Method of the bake.
    """

    def __init__(self, method: Method) -> None:
        self.method, self.name, self.cost = method, method.name, method.cost

    def eval(self, n: mi.Vector3f, v: mi.Vector3f) -> mi.Color3f:
        """See `Method.eval`."""
        return self.method.eval(n, v)

    @backend.in_session
    def map(self, frame: NDArray[np.float64], resolution: int) -> mi.TensorXf:
        """Map of a view, indexed by `BY_NORMAL_OF_ALL`; for its layout see `Method.map`."""
        columns = mi.Float(frame.T.ravel().tolist())
        dr.make_opaque(columns)  # an input of the kernel, so that another view compiles nothing
        to_world = frame_from(columns)
        texel = tiled_texels(resolution)
        p = texel_centre(texel, resolution)
        n, view = to_world @ reflection_from_disk(covered_middle(p, resolution)), view_of(to_world)
        v = dr.select(dr.dot(n, view) < LEAST_COSINE, above_horizon(view, n), view)
        radiance = dr.select(touches_disk(p, resolution), as_rgba(self.method.eval(n, v)), 0)
        return mi.TensorXf(laid_out(radiance, texel, resolution), (resolution, resolution, 4))
