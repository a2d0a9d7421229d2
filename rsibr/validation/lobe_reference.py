"""Reference of each lobe at a view, by the integrator of the bake, because a path tracer cannot separate lobes.

It shares integrator and lobe split with the bake, but no random numbers. It therefore measures the error of carrying a
lobe to a new view. An error of the integrator itself appears only against the path-traced reference of the whole map.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.baking.integrator import SphereIntegrator

_LOBE_BRANCH = 0x6C6F_6265
"""Branch of the seed tree (the letters "lobe"); no random number is shared with the bake."""


class LobeReference:
    """Renders each lobe of a scene at any view, in independent buffers.

    Parameters
    ----------
    integrator : SphereIntegrator
        Integrator of the scene with all lobes separate, nothing left out or clamped; see
        `rsibr.baking.parts.SceneParts.integrator`.
    samples, buffers : int
        Minimum samples a texel in total, and number of buffers.
    seed : int
        Root of the seed tree.
    """

    def __init__(self, integrator: SphereIntegrator, *, samples: int, buffers: int, seed: int) -> None:
        self._integrator = integrator
        self._each, self._buffers, self._seed = -(-samples // buffers), buffers, seed

    @property
    def samples(self) -> int:
        """Samples a texel of all buffers together."""
        return self._each * self._buffers

    @property
    def names(self) -> list[str]:
        """Names of the lobes in order; "radiance" if the material has only one."""
        return self._integrator.lobe_names

    @property
    def coverage(self) -> NDArray[np.float32]:
        """Share of each texel inside the disk, shape (N, N)."""
        return self._integrator.coverage

    def buffers(self, frame: NDArray[np.float64]) -> NDArray[np.float32]:
        """Render the covered texels at the view of `frame`, columns x, y, v; shape (buffers, texels, lobes, 3)."""
        view = (frame[:, 2] + 0.0).view(np.uint32)  # + 0.0: −0 and 0 are one direction
        branches = [(_LOBE_BRANCH, *map(int, view), number) for number in range(self._buffers)]
        seeds = [np.random.SeedSequence(self._seed, spawn_key=branch) for branch in branches]
        with backend.rendering(self._integrator.rendering):
            return np.stack([self._integrator.block(frame, self._each, branch) for branch in seeds])

    def image(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Scatter values of the covered texels into an image, zero elsewhere."""
        return self._integrator.image(values)
