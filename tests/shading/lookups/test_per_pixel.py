import drjit as dr
import mitsuba as mi
import numpy as np

from tests.shading.analytic import Method, centres, directions, framing, on_ball, pictured


def test_a_pixel_is_seen_from_its_own_view():
    """Radiance n·v and the mirror direction, against closed-form hits."""
    camera = framing(20)
    method = Method(lambda n, v: mi.Color3f(dr.dot(n, v), 2 + (2 * dr.dot(n, v) * n - v).x, 2 + v.y))
    radiance = pictured(method, camera, 1).radiance
    d = directions(camera, *centres(camera))
    distance, n = on_ball(camera, d)
    hit = np.isfinite(distance)
    cosine = -(n * d).sum(axis=-1)
    exact = np.stack([cosine, 2 + (2 * cosine[..., None] * n + d)[..., 0], 2 - d[..., 1]], axis=-1)
    assert np.allclose(radiance[hit], np.maximum(exact, 1e-3)[hit], atol=4e-3)


def test_the_method_sees_no_surface_below_its_horizon():
    method = Method(lambda n, v: mi.Color3f(dr.select(dr.dot(n, v) > 0, mi.Float(1), mi.Float(dr.nan))))
    picture = pictured(method, framing(24), 16)
    assert np.isfinite(picture.radiance).all()
    assert np.allclose(picture.radiance[..., 0], picture.alpha)
