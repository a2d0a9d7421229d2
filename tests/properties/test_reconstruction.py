"""Properties of whole reconstructions: equivariance, invariance, interpolation, bounds, and float64 beside float32."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.geometry.spherical import area_weights
from rsibr.geometry.viewpoints import from_directions, icosphere
from rsibr.methods.warp_blend.blend import triangle_mix
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import MirrorWarp
from rsibr.methods.warp_blend.warp_blend import WarpBlend
from tests.methods.scene import image, inside, matte_sphere, mirror_sphere, normals, sky
from tests.methods.warp_blend.test_method import METHODS
from tests.properties.float64 import cabral1999
from tests.properties.strategies import PROFILE, angles, directions, rotations, seeds

N = 32
VIEWS = icosphere(0)
COVERAGE = texel_coverage(N).astype(np.float32)
FRAMES = np.stack([view_frame(d) for d in VIEWS.directions])
EXACT = [name for name in METHODS if name != "mesh"]
NOT_NEAREST = [name for name in EXACT if name != "nearest"]  # which jumps where two views are equally near


def made(maps, views=VIEWS, frames=FRAMES, name="cabral1999", coverage=COVERAGE):
    """A method over maps (12, N, N, 3), always of one shape, so that its kernels are compiled once."""
    options = {"mix": triangle_mix(area_weights), "warp": MirrorWarp, "kind": WarpBlend} | METHODS[name]
    sources = SourceMaps.from_arrays(maps.astype(np.float32), np.tile(coverage, (len(maps), 1, 1)), frames)
    return options["kind"](name, views, sources, options["mix"], options["warp"])


def spheres(sphere, frames=FRAMES):
    return np.stack([sphere(frame, N) for frame in frames])


def random_maps(seed):
    """Maps that no warp fits: each texel for itself, in [0, 1] with a zero here and there."""
    maps = np.random.default_rng(seed).random((len(VIEWS), N, N, 3))
    return np.where(maps < 0.1, 0.0, maps)


def turned_about(frame, angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    return frame @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


@pytest.mark.parametrize("name", NOT_NEAREST)
@PROFILE
@given(rotation=rotations(), view=directions, seed=seeds)
def test_environment_views_and_result_rotate_together(rotation, view, seed, name):
    """Maps, frames, stored directions and the new view turned by R give the same image, be the maps what they may.

    To 1e-4, on maps that jump by 1 from texel to texel: 16 texels a radius carry a float32 rounding that far. The
    triangles are turned with the views; a view on an edge may fall to either side, and its weights do not jump at
    level 0.
    """
    maps = random_maps(seed)
    turned_views = from_directions(VIEWS.directions @ rotation.T, VIEWS.triangles)
    plain = image(made(maps, name=name), view_frame(view), N)
    turned = image(made(maps, turned_views, rotation @ FRAMES, name), rotation @ view_frame(view), N)
    assert np.abs(plain - turned)[inside(N)].max() < 1e-4


@PROFILE
@given(rotation=rotations(), view=directions)
def test_a_rotated_sky_rotates_the_reconstruction(rotation, view):
    """The sky turned, the stored views left where they are: the new view turned shows the same, as far as each is true.

    Different sources and maps stand behind the two; both are within the bilinear lookup of the mirror's closed form.
    """

    def under_turned_sky(frame, resolution):
        n, v = normals(frame, resolution), frame[:, 2]
        return sky((2 * (n @ v)[..., None] * n - v) @ rotation)

    frame = view_frame(view)
    plain = image(made(spheres(mirror_sphere)), frame, N)
    turned = image(made(spheres(under_turned_sky)), rotation @ frame, N)
    assert np.abs(plain - turned)[inside(N, 0.8)].max() < 0.05


@pytest.mark.parametrize("name", NOT_NEAREST)
@PROFILE
@given(view=directions, angle=angles, rolls=st.lists(angles, min_size=12, max_size=12))
def test_frames_may_be_rolled_about_their_views(view, angle, rolls, name):
    """Stored maps and the new one in frames rolled by any angles: the same radiance at the same world normals.

    Rolled maps are sampled at other places, so that the two agree to the bilinear lookup of a smooth sky; a quarter
    turn samples the same places and agrees to 1e-4.
    """
    sphere = {"blend": matte_sphere, "normal": matte_sphere}.get(name, mirror_sphere)
    frame = view_frame(view)
    plain = image(made(spheres(sphere), name=name), frame, N)
    rolled_frames = np.stack([turned_about(f, roll) for f, roll in zip(FRAMES, rolls, strict=True)])
    rolled = image(made(spheres(sphere, rolled_frames), frames=rolled_frames, name=name), frame, N)
    assert np.abs(plain - rolled)[inside(N, 0.8)].max() < 0.02
    quarter = image(made(spheres(sphere), name=name), turned_about(frame, np.pi / 2), N)
    assert np.abs(np.rot90(plain, -1) - quarter)[inside(N, 0.95)].max() < 1e-4


@pytest.mark.parametrize("name", METHODS)
@PROFILE
@given(index=st.integers(0, 11), seed=seeds)
def test_stored_views_are_interpolated_exactly(index, seed, name):
    """At a stored view the stored map comes back, whatever it holds: to 2e-5, a rounding of the place in 16 texels.

    The outermost texels apart, whose centre the rim may put into a neighbour.
    """
    maps = random_maps(seed)
    got = image(made(maps, name=name), view_frame(VIEWS.directions[index]), N)
    assert np.abs(got - maps[index])[inside(N)].max() < 1e-4


@pytest.mark.parametrize("name", METHODS)
@PROFILE
@given(view=directions, seed=seeds)
def test_a_blend_stays_within_its_sources(view, seed, name):
    """Non-negative, and between the least and the greatest of the stored texels: to 4 ulp of the greatest."""
    maps = random_maps(seed)
    got = image(made(maps, name=name), view_frame(view), N)[inside(N)]
    assert np.isfinite(got).all()
    assert got.min() >= 0
    assert got.min() >= maps.min()
    assert got.max() <= maps[:, COVERAGE > 0].max() * (1 + 4 * 2**-23)


ERROR_BOUND = 2e-5
"""Of float32 against float64, on maps with jumps of 1 between texels, relative to their greatest value.

A place in a map errs by a few roundings (1e-7) over |r + v_s|; a lookup carries that to 16 texels a radius: some 2e-6
where |r + v_s| is about 1 (2.2e-6 were measured within 0.9 of the disk, 5.6e-6 up to its rim). Closer to a source's
singularity the weight of the source falls with |r + v_s| as fast as its place worsens.
"""


@PROFILE
@given(view=directions, seed=seeds)
def test_float32_agrees_with_float64(view, seed):
    """The paper's method against an implementation of its own in NumPy, on random maps: within `ERROR_BOUND`.

    The maps fill the whole square, so that nothing depends on how texels outside the disk are filled (hard case 13).
    """
    maps = random_maps(seed).astype(np.float32).astype(np.float64)
    frame = view_frame(view)
    exact = cabral1999(VIEWS.directions, VIEWS.triangles, maps, FRAMES, frame)
    got = image(made(maps, coverage=np.ones_like(COVERAGE)), frame, N)
    assert np.abs(got - exact)[inside(N)].max() < ERROR_BOUND
