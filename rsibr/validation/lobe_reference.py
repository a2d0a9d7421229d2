"""The truth of each lobe at a view: a path tracer cannot say which lobe light came from, so the bake's integrator does.

It shares the integrator and the split of the material with the bake, and no random number: what it judges is how a lobe
was carried to a new view. An error of the integrator itself shows only against the path-traced reference of the whole.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rsibr import backend
from rsibr.baking.integrator import SphereIntegrator

_LOBE_BRANCH = 0x6C6F_6265
"""Branch of the seed tree (the letters "lobe"): the references share no samples with the bake."""


class LobeReference:
    """Renders each lobe of a scene at any view, in independent buffers.

    Parameters
    ----------
    integrator : SphereIntegrator
        Of the scene: all lobes kept apart, nothing left out or clamped; see `rsibr.baking.parts.SceneParts.integrator`.
    samples, buffers : int
        Samples a texel in all, at least, and in how many buffers.
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
        """Names of the lobes in their order; "radiance" where the material has but one."""
        return self._integrator.lobe_names

    @property
    def coverage(self) -> NDArray[np.float32]:
        """Share of each texel inside the disk, shape (N, N)."""
        return self._integrator.coverage

    def buffers(self, frame: NDArray[np.float64]) -> NDArray[np.float32]:
        """Radiance of the covered texels at the view of `frame`, columns x, y, v; shape (buffers, texels, lobes, 3)."""
        view = (frame[:, 2] + 0.0).view(np.uint32)  # + 0.0: −0 and 0 are one direction
        branches = [(_LOBE_BRANCH, *map(int, view), number) for number in range(self._buffers)]
        seeds = [np.random.SeedSequence(self._seed, spawn_key=branch) for branch in branches]
        with backend.rendering(self._integrator.rendering):
            return np.stack([self._integrator.block(frame, self._each, branch) for branch in seeds])

    def image(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Lay values of the covered texels out as an image, zero elsewhere."""
        return self._integrator.image(values)
