"""Warp and blend of a whole map at 512², three sources, against OpenCV doing the same work, in one run."""

import cv2
import drjit as dr
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from tests.arrays import unit_vectors
from tests.reconstruct.scene import method

N = 512


@pytest.fixture(scope="module")
def made():
    """The paper's method over twelve maps of 512², compiled."""
    made = method(resolution=N)
    dr.eval(made.map(view_frame([1, 2, 3]), N))
    return made


@pytest.fixture
def frames(rng):
    """Frames of 64 views, to draw from in turn: no view is warm."""
    return [view_frame(v) for v in unit_vectors(rng, 64)]


@pytest.mark.benchmark(group="warp and blend, 512², three sources")
def test_cabral1999_texel_by_texel(benchmark, made, frames):
    """Warp coordinates, fade, weights, three bilinear lookups and the blend, for a new view each time."""
    views = iter(frames * 1000)

    def frame():
        dr.eval(made.map(next(views), N))
        dr.sync_thread()

    benchmark(frame)


@pytest.mark.benchmark(group="warp and blend, 512², three sources")
def test_opencv_remap_three_times_and_add_weighted(benchmark, rng):
    """The peer, which is spared the warp: its coordinates are computed beforehand."""
    sources = [rng.random((N, N, 4), dtype=np.float32) for _ in range(3)]
    row, column = np.mgrid[0:N, 0:N].astype(np.float32)
    x, y = column + 1.3 * np.sin(row / 40), row + 2 * np.cos(column / 50)

    def frame():
        a, b, c = (cv2.remap(source, x, y, cv2.INTER_LINEAR) for source in sources)
        return cv2.addWeighted(cv2.addWeighted(a, 0.3, b, 0.3, 0), 1.0, c, 0.4, 0)

    benchmark(frame)
