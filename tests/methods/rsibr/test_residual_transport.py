"""Residuals: nothing is lost at a stored view, whatever the model; elsewhere they count as the formula says."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.geometry.spherical import gnomonic_weights
from rsibr.geometry.viewpoints import icosphere
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.light.radiance import Light
from rsibr.lobes.albedo import node_cosines
from rsibr.methods.lobe_albedo import LobeAlbedo
from rsibr.methods.rsibr.fidelity import FAST, FINE
from rsibr.methods.rsibr.half_vector_lobes import HalfVectorLobes
from rsibr.methods.rsibr.residual_transport import DARKEST, clamped, trusted, warped_residual
from rsibr.methods.rsibr.rsibr import Rsibr
from rsibr.methods.warp_blend.blend import Mixture, triangle_mix
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import MirrorWarp
from tests.arrays import to_numpy, unit_vectors, vector
from tests.light.test_environment_pyramid import picture
from tests.lobe_shapes import ggx
from tests.methods.scene import image, inside, mirror_sphere, sky

N = 48
ALBEDO = (0.1 + 0.5 * node_cosines())[:, None] * np.ones(3)


def maps(images, frames):
    coverage = np.tile(texel_coverage(N).astype(np.float32), (len(frames), 1, 1))
    return SourceMaps.from_arrays(np.stack(images), coverage, np.stack(frames))


def modelled(kind, light):
    """A method whose maps are a perfect mirror's, and whose model believes in a rough metal under `light`."""
    views = icosphere(0)
    frames = [view_frame(d) for d in views.directions]
    stored = [mirror_sphere(frame, N) for frame in frames]
    stack = EnvironmentPyramid.of(light)
    common = ("test", views, maps(stored, frames), triangle_mix(gnomonic_weights), MirrorWarp)
    fidelity = {"rsibr": FAST, "rsibr-fine": FINE}[kind]
    made = Rsibr(
        *common,
        albedo=LobeAlbedo.of(ALBEDO),
        lobes_of_maps=HalfVectorLobes.of([(ggx(0.1), ALBEDO)], stack, Light(light), fidelity=fidelity),
        points=lambda: pytest.fail("a map needs no single points"),
    )
    made.sources = maps([made.residual_of(m, f) for m, f in zip(stored, frames, strict=True)], frames)
    return made


LIGHTS = {
    "true": lambda: picture(sky, 64),
    "wrong": lambda: picture(lambda d: 3 * sky(-d), 64),
    "black": lambda: np.zeros((64, 64, 3), np.float32),
}


@pytest.mark.parametrize("kind", ["rsibr", "rsibr-fine"])
@pytest.mark.parametrize("name", LIGHTS)
def test_stored_views_come_back_whatever_the_model_is(kind, name):
    """To the packing of texels (7.6e-6 of the residual's greatest channel), at every texel centre inside the disk."""
    made = modelled(kind, LIGHTS[name]())
    for index in (0, 5, 11):
        frame = view_frame(made.viewpoints.directions[index])
        error = np.abs(image(made, frame, N) - mirror_sphere(frame, N))[inside(N, 0.99)]
        assert error.max() < 1e-4  # of radiances up to 3, and residuals as large over an albedo of 0.1 to 0.6


@pytest.mark.parametrize("kind", ["rsibr", "rsibr-fine"])
@pytest.mark.parametrize("name", ["true", "wrong"])
def test_between_views_maps_mend_what_the_model_gets_wrong(kind, name):
    """Here most of it: a metal of a third of the albedo, and rough, for a mirror."""
    frame, radius = view_frame([0.3, 0.4, -0.8]), inside(N, 0.9)
    made = modelled(kind, LIGHTS[name]())
    with_maps = np.abs(image(made, frame, N) - mirror_sphere(frame, N))[radius].mean()
    made = modelled(kind, LIGHTS[name]())
    made.uses_maps = False
    alone = np.abs(image(made, frame, N) - mirror_sphere(frame, N))[radius].mean()
    assert with_maps < 0.3 * alone


@pytest.mark.parametrize("kind", ["rsibr", "rsibr-fine"])
def test_finite_at_antipodes_rim_and_beside_stored_views(kind, rng):
    made = modelled(kind, LIGHTS["wrong"]())
    stored = made.viewpoints.directions[2]
    views = [
        -stored,
        stored + 1e-7 * np.array([0.3, -0.8, 0.5]),
        stored + 1e-3,
        *unit_vectors(rng, 2),
        [0, 1, 0],
        [0, -1, 0],
    ]
    for view in views:
        found = made.map(view_frame(view), N).numpy()
        assert np.isfinite(found).all()
        assert found.min() >= 0


# --- The formula ------------------------------------------------------------------------------------------------------


def even(values):
    """Stored maps of one colour each."""
    frames = [view_frame(d) for d in np.eye(3)[: len(values)]]
    return maps([np.full((N, N, 3), v, np.float32) for v in values], frames)


def fixed(cosine):
    """A warp that lands where the stored view sees the surface at `cosine`, whatever the normal."""
    return SimpleNamespace(normal=lambda n: vector([[np.sqrt(1 - cosine**2), 0, cosine]]) + 0 * n)


def carry(values, weights, theres, here, damped=True):
    sources = even(values)
    views = [sources.view(mi.UInt32(i)) for i in range(len(values))]
    mixture = Mixture(views, [mi.Float(w) for w in weights])
    n = vector([[np.sqrt(1 - here**2), 0, here]])
    return to_numpy(warped_residual(sources, mixture, [fixed(there) for there in theres], n, n.z, damped))[0, 0]


def test_views_that_see_the_surface_alike_are_blended_by_weight():
    assert carry([1.0, 5.0], [0.25, 0.75], [0.6, 0.6], 0.6) == pytest.approx(4.0, rel=2e-4)


def test_a_residual_is_trusted_by_its_cosine():
    """Σ w c² ρ² R / Σ w c²: here c = 0.8 and 0.4 around 0.6, so that ρ = 3/4 and 2/3."""
    c = np.array([0.8, 0.4])
    overlap = np.array([0.6 / 0.8, 0.4 / 0.6])
    exact = (c**2 * overlap**2 * [2.0, 3.0]).sum() / (c**2).sum()
    assert carry([2.0, 3.0], [0.5, 0.5], c, 0.6) == pytest.approx(exact, rel=5e-4)


@pytest.mark.parametrize(("there", "here"), [(0.9, 0.3), (0.3, 0.9)])
def test_a_residual_counts_as_far_as_footprints_overlap(there, here):
    """Alone, with no other view to take its place: by the square of the ratio, either way round."""
    assert carry([2.0], [1.0], [there], here) == pytest.approx(2 / 9, rel=1e-3)


def test_at_the_rim_it_is_finite_and_small():
    assert 0 <= carry([2.0], [1.0], [1.0], 0.0) < 1e-9
    assert carry([2.0], [1.0], [0.0], 0.0) == pytest.approx(2.0, rel=1e-3)


def test_residuals_outshine_a_dark_model_the_less_the_farther_the_stored_views_are():
    """Of 1 over a model of 0.1: 0.15 is left at a centroid, 0.2 at a weight of a half, and all at a stored view."""
    residual, dark = mi.Color3f(1, 0.05, -0.05), mi.Color3f(0.1)
    for weight, brightest in {1 / 3: 0.15, 0.5: 0.2, 1.0: 1.0}.items():
        got = to_numpy(clamped(residual, dark, mixed(weight)))
        assert got.ravel() == pytest.approx([brightest, 0.05, -0.05], rel=1e-5), weight


def mixed(weight):
    """A mixture of three views, one of which has the given weight."""
    return Mixture(views=[], weights=[mi.Float(weight), mi.Float((1 - weight) / 2), mi.Float((1 - weight) / 2)])


def test_residuals_leave_a_part_of_the_model_the_more_the_farther_the_stored_views_are():
    """At least DARKEST (1 − w) of the prediction is left; at a stored view nothing is clamped."""
    for weight in (1 / 3, 0.5, 0.9, 1.0):
        left = 1 + to_numpy(clamped(mi.Color3f(-2), mi.Color3f(1.0), mixed(weight)))[0, 0]
        assert left == pytest.approx(DARKEST * (1 - weight) if weight < 1 else -1, rel=1e-4), weight


def test_trust_falls_with_the_distance_from_the_stored_views():
    """All of a residual at a stored view; γ^(2/3) in the middle of three views."""
    for weight, power in {1.0: 0.0, 0.8: 1 - 0.64 - 0.02, 1 / 3: 2 / 3}.items():
        for trust in (0.3, 0.9):
            assert to_numpy(trusted(mi.Float(trust), mixed(weight)))[0] == pytest.approx(trust**power, rel=1e-5), weight
    assert to_numpy(trusted(mi.Float(0), mixed(1 / 3)))[0] == pytest.approx(0.02 ** (2 / 3), rel=1e-5)
    assert to_numpy(trusted(mi.Float(0), mixed(1.0)))[0] == 1


def test_undamped_residuals_count_whatever_their_overlap():
    assert carry([2.0], [1.0], [0.9], 0.3, damped=False) == pytest.approx(2.0, rel=2e-4)
    assert carry([2.0, 3.0], [0.5, 0.5], [0.8, 0.4], 0.6, damped=False) == pytest.approx(2.2, rel=5e-4)


def test_at_the_rim_of_a_stored_view_its_cosine_is_that_of_the_normal(rng):
    """To the rounding of one rotation; from the point in the map, √(1 − |p|²), it would be off by 6 % at 1e-3."""
    frame = view_frame([0.3, 0.5, -0.8])
    height, turn = np.geomspace(3e-4, 0.1, 2000), rng.random(2000) * 2 * np.pi
    radius = np.sqrt(1 - height**2)
    n = vector(np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1))
    sources = maps([np.zeros((N, N, 3), np.float32)], [frame])
    matrix = mi.Matrix3f(frame.astype(np.float32))
    stored = MirrorWarp.between(sources.view(mi.UInt32(0)), matrix).normal(n)
    assert to_numpy(stored.z) == pytest.approx(height, rel=2e-3)
    noise = 1 - to_numpy(stored.x) ** 2 - to_numpy(stored.y) ** 2
    assert np.abs(np.sqrt(np.maximum(noise, 0)) / height - 1).max() > 2e-2
