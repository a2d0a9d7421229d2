import mitsuba as mi
import numpy as np

from rsibr.geometry.frame import view_frame
from rsibr.shading.cameras.camera import Camera
from rsibr.shading.maps.mixed_chain import MixedChain
from tests.arrays import disk_grid
from tests.shading.analytic import Method, pictured, slanted

ASIDE = Camera.look_at((0, 0, 1.6), (2.2, 0, 0.4), fov_deg=90, width=24, height=24)
"""The ball lies far from the axis: some of its normals face away from the view direction."""


def test_texels_hold_the_normal_that_points_as_their_mirror_direction():
    frame = view_frame([1, 2, 0.5])
    found = MixedChain(slanted()).map(frame, 32).numpy()
    x, y = disk_grid(32)
    z = np.sqrt(np.maximum(0, 1 - x * x - y * y))
    n = np.stack([2 * x * z, 2 * y * z, 2 * z * z - 1], axis=-1) @ frame.T
    inside = np.hypot(x, y) < 0.9
    assert (n[inside] @ frame[:, 2]).min() < -0.5
    assert np.allclose(found[..., :3][inside], 1 + 0.5 * n[inside], atol=1e-4)


def test_views_are_never_below_the_horizon():
    import drjit as dr

    cosine = Method(lambda n, v: mi.Color3f(dr.dot(n, v)))
    found = MixedChain(cosine).map(view_frame([0, 0, 1]), 32).numpy()
    assert found[..., 0][found[..., 3] > 0].min() > 0


def test_matte_surfaces_are_exact_beyond_the_horizon_of_the_map():
    truth = pictured(slanted(), ASIDE, 4)
    inside = truth.alpha == 1
    assert inside.sum() > 10
    plain, mixed = (
        np.abs(pictured(slanted(), ASIDE, 4, "map-normal", chain=chain).radiance - truth.radiance)[inside].max()
        for chain in ("normal", "mixed")
    )
    assert mixed < 0.01
    assert plain > 10 * mixed
