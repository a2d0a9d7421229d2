"""Warp and blend of whole maps, three sources, a new view each time, against its peers in one run.

The peers: OpenCV doing the same lookups at given coordinates, once as it is called by everybody and once into memory
that it is given; and a copy of as many bytes as must be touched, on one thread. OpenCV is the newest of the 4 series,
which the project's first figures were taken against; the `remap` of 5.0 takes 0.6 of its time.
"""

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import normal_from_disk, texel_centres
from tests.arrays import unit_vectors
from tests.benchmarks.turns import in_turns, report
from tests.methods.scene import inside, method, mirror_sphere

VIEWS = 16
BATCH = 64
TEXEL_BYTES, RGBA_BYTES = 8, 16


@pytest.fixture(params=[256, 512, 1024])
def resolution(request):
    """Texels a side, of the stored maps and of the new ones."""
    return request.param


@pytest.fixture
def frames(rng):
    """Frames of the views."""
    return [view_frame(v) for v in unit_vectors(rng, VIEWS)]


@pytest.mark.benchmark(group="warp and blend")
def test_cabral1999_against_opencv_and_a_copy(benchmark, resolution, frames):
    """Ours: point location, weights, warp coordinates, fade, three bilinear lookups a texel, and the blend."""
    made = method(resolution=resolution)
    lookups = [_lookups(made, frame, resolution) for frame in frames]
    maps = [_bordered(mirror_sphere(view_frame(v), resolution)) for v in made.viewpoints.directions]
    _check_that_they_look_up_the_same(made, maps, lookups[0], resolution)
    into = [np.empty_like(maps[0]) for _ in range(3)]
    touched = _bytes_touched(resolution)
    source, target = np.ones((2, VIEWS * touched), np.uint8)  # another place each time, as the views are
    parts = [slice(view * touched, (view + 1) * touched) for view in range(VIEWS)]
    contenders = {
        "ours": lambda view: _frame(made, frames[view], resolution),
        "OpenCV": lambda view: _opencv(maps, lookups[view]),
        "OpenCV into its memory": lambda view: _opencv(maps, lookups[view], into),
        "copy": lambda view: np.copyto(target[parts[view]], source[parts[view]]),
    }
    seconds = in_turns(contenders, calls=VIEWS)
    benchmark.pedantic(lambda: _frame(made, frames[0], resolution), rounds=20, warmup_rounds=1)
    evenness = float(np.percentile(seconds["ours"], 99) / np.median(seconds["ours"]))
    facts = {"p99_over_p50": evenness, "opencv": cv2.__version__}
    report(benchmark, f"warp and blend, {resolution}²", seconds, **facts)


@pytest.mark.benchmark(group="warp and blend")
def test_64_views_queued_at_once(benchmark, rng):
    """The device never waits for the next view: its host's work is done meanwhile."""
    size = 256
    made, frames = method(resolution=size), [view_frame(v) for v in unit_vectors(rng, BATCH)]

    def queued(_):
        images = [made.map(frame, size) for frame in frames]
        dr.eval(images)
        dr.sync_thread()

    def one_by_one(_):
        for frame in frames:
            _frame(made, frame, size)

    seconds = in_turns({"ours": queued, "one by one": one_by_one})
    benchmark.pedantic(lambda: queued(0), rounds=5, warmup_rounds=1)
    report(benchmark, f"{BATCH} views of {size}² queued at once", seconds)


def _frame(made, frame, resolution):
    dr.eval(made.map(frame, resolution))
    dr.sync_thread()


def _opencv(maps, lookups, into=(None, None, None)):
    """The peer is spared the warp, the fade and the point location: its coordinates and weights are given."""
    a, b, c = (
        cv2.remap(maps[index], x, y, cv2.INTER_LINEAR, dst=out)
        for (index, x, y, _), out in zip(lookups, into, strict=True)
    )
    w = [share for *_, share in lookups]
    two = cv2.addWeighted(a, w[0], b, w[1], 0, dst=into[0])
    return cv2.addWeighted(two, 1.0, c, w[2], 0, dst=into[0])


def _lookups(made, frame, resolution):
    """For each source of a view: which map, the pixel coordinates in it, and the weight."""
    matrix = mi.Matrix3f(frame.astype(np.float32))
    mixture, warps = made._toward(matrix)
    n = normal_from_disk(texel_centres(resolution))
    found = []
    for stored, weight, warp in zip(mixture.views, mixture.weights, warps, strict=True):
        p = np.array(warp(n)[0]).reshape(2, resolution, resolution)
        half = resolution / 2
        x, y = (p[0] + 1) * half + 0.5, (1 - p[1]) * half + 0.5  # pixel centres, past the border of one
        index, share = int(np.array(stored.index)[0]), float(np.array(weight)[0])
        found.append((index, np.ascontiguousarray(x), np.ascontiguousarray(y), share))
    return found


def _bordered(image):
    """RGBA with a border of one texel: OpenCV is fastest with four channels."""
    return np.pad(np.dstack([image, np.ones(image.shape[:2], np.float32)]), ((1, 1), (1, 1), (0, 0)), mode="edge")


def _check_that_they_look_up_the_same(made, maps, lookups, resolution):
    index, x, y, _ = lookups[0]
    half = resolution / 2
    p = mi.Point2f(((x - 0.5) / half - 1).ravel(), (1 - (y - 0.5) / half).ravel())
    ours = np.array(made.sources.fetch(mi.UInt32(index), p)).T.reshape(resolution, resolution, 3)
    theirs = cv2.remap(maps[index], x, y, cv2.INTER_LINEAR)[..., :3]
    assert np.abs(ours - theirs)[inside(resolution, 0.8)].max() < 0.01


def _bytes_touched(resolution):
    """Three disks of packed texels read, one square of RGBA float32 written."""
    return int((3 * np.pi / 4 * TEXEL_BYTES + RGBA_BYTES) * resolution**2)
