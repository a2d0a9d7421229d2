"""Warp and blend of a whole map at 512², three sources, against OpenCV doing the same lookups, in one run."""

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.sphere_map import normal_from_disk, texel_centres
from tests.arrays import unit_vectors
from tests.reconstruct.scene import method

N = 512
VIEWS = 16


@pytest.fixture(scope="module")
def made():
    """The paper's method over twelve maps of 512², compiled."""
    made = method(resolution=N)
    dr.eval(made.map(view_frame([1, 2, 3]), N))
    return made


@pytest.fixture
def frames(rng):
    """Frames of the views, to draw from in turn."""
    return [view_frame(v) for v in unit_vectors(rng, VIEWS)]


@pytest.mark.benchmark(group="warp and blend, 512², three sources")
def test_cabral1999_texel_by_texel(benchmark, made, frames):
    """Point location, weights, warp coordinates, fade, three bilinear lookups and the blend: a new view each time."""
    views = iter(frames * 10_000)

    def frame():
        dr.eval(made.map(next(views), N))
        dr.sync_thread()

    benchmark(frame)


@pytest.mark.benchmark(group="warp and blend, 512², three sources")
def test_opencv_remap_three_times_and_add_weighted(benchmark, made, frames):
    """The peer looks up the same texels of the same maps, and is spared the warp: its coordinates are given."""
    images = np.array(made.sources.texels).reshape(len(made.viewpoints), N + 2, N + 2, 4)
    given = iter([_lookups(made, frame) for frame in frames] * 10_000)

    def frame():
        (i, x0, y0, w0), (j, x1, y1, w1), (k, x2, y2, w2) = next(given)
        a = cv2.remap(images[i], x0, y0, cv2.INTER_LINEAR)
        b = cv2.remap(images[j], x1, y1, cv2.INTER_LINEAR)
        c = cv2.remap(images[k], x2, y2, cv2.INTER_LINEAR)
        return cv2.addWeighted(cv2.addWeighted(a, w0, b, w1, 0), 1.0, c, w2, 0)

    benchmark.extra_info["opencv"] = cv2.__version__
    benchmark(frame)


@pytest.mark.benchmark(group="warp and blend, 512², three sources")
def test_copy_of_the_bytes_that_it_must_touch(benchmark):
    """The floor: three maps read, one written, RGBA float32."""
    maps = np.ones((2, N, N, 4), dtype=np.float32)
    copy = np.empty_like(maps)
    benchmark(lambda: np.copyto(copy, maps))  # 8 MiB read and 8 written: the same 16 MiB


def _lookups(made, frame):
    """For each source of a view: which map, the pixel coordinates in it, and the weight."""
    matrix = mi.Matrix3f(frame.astype(np.float32))
    mixture, warps = made._toward(matrix)
    n = normal_from_disk(texel_centres(N))
    found = []
    for stored, weight, warp in zip(mixture.views, mixture.weights, warps, strict=True):
        p = np.array(warp(n)[0]).reshape(2, N, N)
        x, y = (p[0] + 1) * N / 2 + 0.5, (1 - p[1]) * N / 2 + 0.5  # pixel centres, past the border of one
        index, share = int(np.array(stored.index)[0]), float(np.array(weight)[0])
        found.append((index, np.ascontiguousarray(x), np.ascontiguousarray(y), share))
    return found
