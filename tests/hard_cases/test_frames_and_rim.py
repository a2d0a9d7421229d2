"""Hard cases 9 to 15: frames, the sphere map's singularity, its rim and what lies outside it."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import norm

from rsibr.baking.blocks import Blocks
from rsibr.baking.integrator import SphereIntegrator
from rsibr.baking.view import bake_view
from rsibr.errors import InputError
from rsibr.geometry.frame import frame_of, transported, unit_view, view_frame
from rsibr.geometry.projections.sphere_map import (
    disk_from_reflection,
    normal_from_disk,
    reflection_from_disk,
    texel_centres,
    texel_coverage,
)
from rsibr.geometry.spherical import area_weights
from rsibr.geometry.viewpoints import icosphere
from rsibr.methods.warp_blend.blend import triangle_mix
from rsibr.methods.warp_blend.source_maps import SourceMaps, StoredView
from rsibr.methods.warp_blend.warp import FADE_RADIUS, MirrorWarp
from rsibr.methods.warp_blend.warp_blend import WarpBlend
from rsibr.scene.config import EnvironmentConfig
from rsibr.scene.environment import load_environment
from rsibr.validation.flip import exposures_for
from rsibr.validation.metrics import compare
from rsibr.validation.reference import Reference, ReferenceRenderer
from tests.arrays import disk_grid, point, to_numpy, unit_vectors, vector
from tests.geometry.test_frame import AXES, near_the_poles
from tests.methods.scene import image, inside, method, mirror_sphere, normals, sky
from tests.methods.warp_blend.test_method import METHODS
from tests.validation.doubles import GREY_SKY, MIRROR, disk, smooth_map

N = 32
FURNACE = {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}}
EXACT = [name for name in METHODS if name != "mesh"]  # the mesh rolls with its frame: its error is its own study's


def mirror(emitter, resolution=N):
    return SphereIntegrator(emitter, mi.load_dict({"type": "conductor", "material": "none"}), resolution)


def turn(angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


def test_hc09_device_frames_are_orthonormal_everywhere(rng):
    """±x, ±y, ±z, −0.0, and a million directions near every pole: orthonormal to 3e-7, no NaN.

    Beyond 3e-7 there is the query itself, unit to 1.2e-7 only.
    Fails when the frame does not change its branch with the sign of z, as Frisvad's does not: mutant hc09.
    """
    v = np.concatenate([np.array(AXES, dtype=np.float64), near_the_poles(rng, 1_000_000)]).astype(np.float32)
    v /= np.linalg.norm(v.astype(np.float64), axis=1, keepdims=True)
    frame = to_numpy(frame_of(vector(v)))
    assert np.isfinite(frame).all()
    assert np.abs(np.einsum("ijn,ikn->jkn", frame, frame) - np.eye(3)[..., None]).max() < 3e-7 + 2 * 1.2e-7


@pytest.mark.filterwarnings("error")
def test_hc09_camera_frames_are_orthonormal_everywhere(rng):
    """The upright frame of a view, which is the user's own: the axes, signed zeros, and directions near every pole.

    Fails when nothing stands in for the horizontal where there is none: mutant hc09.
    """
    for view in [*AXES, *near_the_poles(rng, 2000)]:
        frame = view_frame(view)
        assert np.abs(frame.T @ frame - np.eye(3)).max() < 1e-14
        assert np.linalg.det(frame) > 0


@pytest.mark.parametrize("name", EXACT)
def test_hc10_a_rolled_frame_shows_the_same_radiance_in_world_directions(name):
    """The map of a rolled frame holds, at each texel, what `eval` gives for that texel's normal: to 1e-4.

    Fails when the map takes another frame about the view than the one it is asked for: mutant hc10.
    """
    made, frame = method(**METHODS[name]), view_frame([0.3, -0.5, 0.8])
    for angle in (0.7, np.pi / 2, 3.0):
        rolled = frame @ turn(angle)
        n = normals(rolled, N).reshape(-1, 3)
        by_eval = to_numpy(made.eval(vector(n), vector(np.tile(frame[:, 2], (len(n), 1))))).T.reshape(N, N, 3)
        assert np.abs(by_eval - image(made, rolled, N))[inside(N, 0.99)].max() < 1e-4


@pytest.mark.parametrize("name", EXACT)
def test_hc10_stored_maps_may_be_rolled(name):
    """Stored maps whose frames are rolled by angles of their own reconstruct the same radiance.

    Rolled maps are sampled at other places: they agree as the two agree with the truth, to the bilinear lookup.
    Fails when frames reach the device transposed: mutant hc10.
    """
    resolution, frame = 128, view_frame([0.3, -0.5, 0.8])
    views = icosphere(0)
    frames = np.stack([view_frame(d) @ turn(0.5 + i) for i, d in enumerate(views.directions)])
    coverage = np.tile(texel_coverage(resolution).astype(np.float32), (len(views), 1, 1))
    sources = SourceMaps.from_arrays(np.stack([mirror_sphere(f, resolution) for f in frames]), coverage, frames)
    options = {"mix": triangle_mix(area_weights), "warp": MirrorWarp} | METHODS[name]
    rolled = WarpBlend("rolled", views, sources, options["mix"], options["warp"])
    upright = method(resolution=resolution, **METHODS[name])
    within = inside(resolution, 0.9)
    assert np.abs(image(rolled, frame, resolution) - image(upright, frame, resolution))[within].max() < 0.007


@pytest.mark.parametrize("name", [name for name in EXACT if name != "nearest"])  # two views are equally near a pole
@pytest.mark.parametrize("pole", [1, -1])
def test_hc10_nothing_jumps_across_the_branch_cut_of_the_frames(name, pole):
    """Views 1e-7 from a pole, all around it: their upright frames differ by any angle, their radiance does not.

    To 1e-4 for the same world normals; views 1e-7 apart differ by less themselves.
    Fails when the map takes another frame about the view than the one it is asked for: mutant hc10.
    """
    made = method(**METHODS[name])
    at_pole = np.array([0.0, pole, 0.0])
    for angle in np.linspace(0, 2 * np.pi, 7):
        frame = view_frame(at_pole + 1e-7 * np.array([np.cos(angle), 0, np.sin(angle)]))
        n = normals(frame, N).reshape(-1, 3)
        expected = to_numpy(made.eval(vector(n), vector(np.tile(at_pole, (len(n), 1))))).T.reshape(N, N, 3)
        assert np.abs(expected - image(made, frame, N))[inside(N, 0.98)].max() < 1e-4


@pytest.mark.parametrize("away", [0.0, 1e-7, 1e-5, 1e-3, 1e-1])
def test_hc11_the_inverse_of_the_mirror_map_is_finite_at_its_singularity(away):
    """At r = −v and close to it: finite, in the closed disk, and at half the angle from the rim.

    Fails when |r + z| is divided by without a floor, or squared as the paper prints it: mutants hc11.
    """
    around = np.linspace(0, 2 * np.pi, 8)
    r = [[np.sin(away) * np.cos(a), np.sin(away) * np.sin(a), -np.cos(away)] for a in around]
    p = to_numpy(disk_from_reflection(vector(r)))
    assert np.isfinite(p).all()
    assert np.linalg.norm(p, axis=0).max() <= 1 + 1e-6
    if away > 0:
        assert np.abs(p - np.cos(away / 2) * np.stack([np.cos(around), np.sin(around)])).max() < 1e-6


def test_hc11_confidence_fades_linearly_to_the_singularity_as_documented(rng):
    """Distance in the destination map from p_d = warp(−v_s), over the fade radius, at most 1.

    Fails when the fade is left out: mutant hc11.
    """
    v, v_s = unit_vectors(rng, 500), unit_vectors(rng, 500)
    n = unit_vectors(rng, 500)
    n[(n * v).sum(1) < 0] *= -1
    singular = (v - v_s) / np.linalg.norm(v - v_s, axis=1, keepdims=True)
    across = n - singular - ((n - singular) * v).sum(1, keepdims=True) * v
    expected = np.clip(np.linalg.norm(across, axis=1) / FADE_RADIUS, 0, 1)
    frame, frame_s = frame_of(vector(v)), frame_of(vector(v_s)).T
    stored = StoredView(mi.UInt32(0), *(mi.Vector3f(frame_s[axis]) for axis in range(3)))
    _, confidence = MirrorWarp.between(stored, frame)(frame.T @ vector(n))
    assert np.abs(to_numpy(confidence) - expected).max() < 2e-6


def test_hc11_radiance_is_finite_and_continuous_through_the_singularity():
    """A source 1e-7 … 1e-1 rad from its singularity: no jump, and at a stored view even a lone source stays finite.

    Each step of a decade changes the radiance by less than its own length would at the map's steepest (N/2 texels a
    radius, values within 2.5), and by a rounding.
    Fails when nothing keeps the confidences' sum above zero, or the half vector of length zero is normalised: mutants
    hc11.
    """
    made = method(resolution=128)
    stored_view = made.viewpoints.directions[0]
    v = unit_view(stored_view + np.array([0.2, 0.1, 0.05]))
    n = unit_view(v - stored_view)
    tangent = unit_view(np.cross(n, v))
    offsets = np.array([0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1])
    path = n + offsets[:, None] * tangent
    path /= np.linalg.norm(path, axis=1, keepdims=True)
    got = to_numpy(made.eval(vector(path), vector(np.tile(v, (len(path), 1)))))
    assert np.isfinite(got).all()
    assert (np.abs(np.diff(got, axis=1)) < 1e-3 + 160 * np.diff(offsets)).all()

    x, y, v = view_frame(stored_view).T  # the lone source: at its own centre, and on its own rim
    at_home = to_numpy(made.eval(vector([v, x, y, -x]), vector([v] * 4))).T
    assert np.isfinite(at_home).all()
    assert np.abs(at_home[0] - sky(v)).max() < 1e-3
    assert np.abs(at_home[1:] - sky(-v)).max() < 0.3  # the rim mirrors the view into −v; its last texel spans 20°
    odd = image(made, view_frame(stored_view), 33)  # its middle texel's normal is the view to the last bit
    assert np.abs(odd[16, 16] - sky(v)).max() < 1e-3


def test_hc12_normals_on_the_rim_are_finite(rng):
    """Points on the unit circle to the last bit, and beyond it: no NaN from √(1 − x² − y²), which 3.6 % of them were.

    Fails when the root is not guarded: mutant hc12.
    """
    angle = rng.uniform(0, 2 * np.pi, 100_000)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for scale in (1.0, 1 + 1e-7, 1.5):
        n = to_numpy(normal_from_disk(point(scale * rim)))
        assert np.isfinite(n).all()
        assert np.abs(np.linalg.norm(n, axis=0) - 1).max() < 3e-7
        assert n[2].max() < 1e-3


def test_hc12_a_texel_half_outside_shows_the_mean_over_its_inside(gradient_sky, gradient_axis):
    """No dark fringe: rim texels of a mirror under 1 + a·ω against midpoint sums over their part inside the disk.

    Σz over the rim texels / √count, texels with 5 to 95 % in the disk; two-sided, false-alarm rate 1e-4. Σz alone is
    blind to errors that cancel around the rim, so a second test takes them with the sign of a·ρ, ρ outward.
    Fails when points that fall beside the disk are taken to the rim: mutant hc12.
    """
    integrator = mirror(load_environment(EnvironmentConfig(file=gradient_sky)).emitter(), 16)
    frame = view_frame([1.0, 0.0, 0.3])
    baked = bake_view(integrator, frame, Blocks(256, 16), seed=1, index=0)
    fine = 64
    x, y = (grid.reshape(16, fine, 16, fine).transpose(0, 2, 1, 3) for grid in disk_grid(16 * fine))
    covered = np.hypot(x, y) < 1
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    reflected = 1 + np.stack([2 * x * z, 2 * y * z, 2 * z * z - 1], axis=-1) @ (frame.T @ gradient_axis)
    rim = (baked.coverage > 0.05) & (baked.coverage < 0.95)
    exact = (reflected * covered).sum((2, 3))[rim] / covered.sum((2, 3))[rim]
    z_score = (baked.layers["radiance"][..., 0][rim] - exact) / np.sqrt(baked.variance[..., 0][rim])
    outward = np.stack(disk_grid(16), axis=-1)[rim] @ (frame.T @ gradient_axis)[:2]
    spread = np.sqrt(15 / 13 * len(z_score))  # Student's t with 15 degrees of freedom
    for signs in (1.0, np.sign(outward)):
        assert 2 * norm.sf(abs((z_score * signs).sum()) / spread) > 1e-4


def test_hc12_the_reference_has_no_dark_fringe():
    """A white furnace path-traced: 1 in every texel that the sphere touches, however little of it.

    Fails when the reference keeps the coverage in its radiance: mutant hc12.
    """
    reference = ReferenceRenderer(GREY_SKY, MIRROR, N).render(view_frame((1, 2, 3)), 64)
    touched = reference.coverage > 0
    assert (reference.coverage[touched] < 0.5).any()
    assert np.abs(reference.mean[touched] / [1, 2, 0.5] - 1).max() < 1e-5


@pytest.mark.parametrize("poison", [np.nan, 1e30])
@pytest.mark.parametrize("name", METHODS)
def test_hc13_poison_outside_the_disk_changes_no_reconstruction(name, poison):
    """Bit for bit, in the texels that the disk touches.

    Fails when the texels outside are not overwritten with the nearest inside: mutant hc13.
    """

    def poisoned(frame, n):
        return np.where((texel_coverage(n) > 0)[..., None], mirror_sphere(frame, n), np.float32(poison))

    covered = texel_coverage(N) > 0
    for view in ([1, 2, 3], [0, -1, 0]):
        clean, other = (
            image(method(sphere, N, **METHODS[name]), view_frame(view), N) for sphere in (mirror_sphere, poisoned)
        )
        assert np.array_equal(clean[covered], other[covered])


@pytest.mark.parametrize("poison", [np.nan, 1e30])
def test_hc13_poison_outside_the_disk_changes_no_number_of_a_comparison(poison):
    """Every number of `compare`, bit for bit.

    Fails when FLIP gets to see the whole square: mutant hc13.
    """
    reference = Reference(np.stack([smooth_map()] * 8), disk(), samples=64, seconds=1.0)
    outside = (disk() == 0)[..., None]
    candidate = np.float32(1.1) * smooth_map()
    clean, other = (
        compare(np.where(outside, np.float32(fill), candidate), reference, exposures_for(1.0)) for fill in (0, poison)
    )
    for name in ("rel_mse", "rel_mse_channels", "rel_mse_zones", "smape", "flip", "energy_ratio", "worst_texel"):
        assert getattr(clean, name) == getattr(other, name)
    assert np.array_equal(clean.relative_error, other.relative_error, equal_nan=True)
    assert np.array_equal(clean.flip_map, other.flip_map, equal_nan=True)


def test_hc14_the_mirror_map_spreads_its_texels_evenly_over_the_sphere():
    """Σ 4 dA = 4π ± 0.5 % at 256², and the moments 0, 4π/3 of the directions with it.

    Fails when the coverage leaves the disk out, or the map sends the rim elsewhere: mutants hc14.
    """
    n = 256
    weight = 4 * texel_coverage(n).ravel() * (2 / n) ** 2
    r = to_numpy(reflection_from_disk(texel_centres(n)))
    assert weight.sum() == pytest.approx(4 * np.pi, rel=5e-3)
    assert np.abs(r @ weight).max() < 5e-3 * 4 * np.pi
    assert np.allclose(r**2 @ weight, 4 * np.pi / 3, rtol=5e-3)


@pytest.mark.parametrize("name", METHODS)
def test_hc15_the_antipode_of_a_stored_view_works(name):
    """Finite and within the range of the stored maps; the icosahedron's antipodes are stored views themselves.

    Fails when an antipode is taken for the nearest view: mutant hc15.
    """
    made = method(**METHODS[name])
    for index in (0, 7):
        frame = view_frame(-made.viewpoints.directions[index])
        got = image(made, frame, N)[inside(N)]
        assert np.isfinite(got).all()
        assert np.abs(got - mirror_sphere(frame, N)[inside(N)]).mean() < 0.02


def test_hc15_the_least_rotation_between_antipodes_is_finite(rng):
    """It is not unique there, but no NaN: not exactly at the antipode, nor 1e-7 … 1e-3 rad from it.

    Fails when 1 + cos is not kept above zero: mutant hc15.
    """
    a, n = unit_vectors(rng, 400), unit_vectors(rng, 400)
    away = np.repeat([0, 1e-7, 1e-5, 1e-3], 100)[:, None]
    b = -a + away * unit_vectors(rng, 400)
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    on_axes = [[0, 1, 0], [1, 0, 0]], [[1, 0, 0], [0, 0, 1]]
    for moved in (
        transported(vector(n), vector(a), vector(b)),
        transported(vector(on_axes[0]), vector(on_axes[1]), -vector(on_axes[1])),
    ):
        assert np.isfinite(to_numpy(moved)).all()


def test_hc15_a_view_need_not_be_normalised():
    """Of any length from 1e-300 to 1e300: the same frame, to the bit of a division.

    Fails when a view is taken as it comes: mutant hc15.
    """
    for length in (1e-300, 1e-3, 7.0, 1e300):
        assert np.allclose(view_frame(length * np.array([0.6, 0.0, 0.8])), view_frame([0.6, 0, 0.8]), atol=1e-15)


@pytest.mark.parametrize("view", [[0, 0, 0], [0.0, -0.0, 0.0], [np.nan, 0, 1], [0, np.inf, 0], [-np.inf, 1, 1]])
def test_hc15_zero_and_nan_are_refused_in_one_line(view):
    """An InputError that names the view.

    Fails when zero, or what is not finite, is let through: mutants hc15.
    """
    for take in (unit_view, view_frame):
        with pytest.raises(InputError, match="direction") as caught:
            take(view)
        assert "\n" not in str(caught.value)
        assert str(caught.value).startswith("view: ")
