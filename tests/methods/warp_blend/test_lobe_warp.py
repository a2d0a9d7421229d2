"""The method `rsibr` where the truth is known in closed form."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from rsibr.baking.baker import bake
from rsibr.errors import BakeError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.geometry.spherical import gnomonic_weights
from rsibr.geometry.viewpoints import icosphere
from rsibr.lobes.albedo import node_cosines
from rsibr.methods.method_set import MethodSet
from rsibr.methods.reconstruction import reconstruct
from rsibr.methods.warp_blend.blend import triangle_mix
from rsibr.methods.warp_blend.footprint_covariance import HALF_VECTOR_VARIANCE, MirrorFootprint
from rsibr.methods.warp_blend.lobe_warp import (
    Corrections,
    LobeGroup,
    LobeMaps,
    LobeWarpMethod,
    _footprint_corrected,
)
from rsibr.methods.warp_blend.source_maps import SourceMaps
from rsibr.methods.warp_blend.warp import MirrorWarp
from tests.arrays import to_numpy, unit_vectors, vector
from tests.methods.scene import image, inside, method, mirror_sphere, normals, sky

N = 64


def schlick(cosine):
    """A strong Fresnel term: the albedo that goes with the surface's angle."""
    return 0.1 + 0.9 * (1 - cosine) ** 5


def coated(frame, resolution):
    """A mirror whose reflectance depends on the angle."""
    cosine = np.clip(normals(frame, resolution) @ frame[:, 2], 0, 1)
    return (mirror_sphere(frame, resolution) * schlick(cosine)[..., None]).astype(np.float32)


def lobed(spheres, resolution=N, corrections=None):
    """The method over stored maps of lobes: (picture, roughness, albedo over the cosine)."""
    views = icosphere(0)
    frames = np.stack([view_frame(d) for d in views.directions])
    coverage = np.tile(texel_coverage(resolution).astype(np.float32), (len(frames), 1, 1))
    lobes = []
    for sphere, alpha, albedo in spheres:
        sources = SourceMaps.from_arrays(np.stack([sphere(f, resolution) for f in frames]), coverage, frames)
        table = np.repeat(albedo(node_cosines())[:, None], 3, axis=1)
        lobes.append(LobeMaps.of(sources, alpha, table))
    mix = triangle_mix(gnomonic_weights)
    common = ("rsibr", views, lobes[0].sources, mix, MirrorWarp)
    groups = [LobeGroup(views.on_device, lobes)]
    return LobeWarpMethod(*common, groups=groups, corrections=corrections or Corrections())


@pytest.mark.parametrize("view", [[1, 2, 3], [0, 1, 0], [-0.3, 0.2, -0.9]])
def test_an_albedo_that_goes_with_the_surface_is_carried_with_it(view):
    """Fresnel times sky is exact up to the lookup; the single warp of 1999 drags the Fresnel term along."""
    frame, radius = view_frame(view), inside(128, 0.97)
    truth = coated(frame, 128)
    ours = np.abs(image(lobed([(coated, 0.001, schlick)], 128), frame, 128) - truth)[radius]
    paper = np.abs(image(method(coated, 128), frame, 128) - truth)[radius]
    assert ours.mean() < 0.05 * paper.mean()


def test_without_the_correction_it_is_not(rng):
    frame = view_frame(unit_vectors(rng, 1)[0])
    plain = Corrections(albedo=False)
    truth, radius = coated(frame, N), inside(N, 0.97)
    with_it, without = (
        np.abs(image(lobed([(coated, 0.001, schlick)], corrections=c), frame, N) - truth)[radius].mean()
        for c in (Corrections(), plain)
    )
    assert without > 5 * with_it


@pytest.mark.parametrize("index", [0, 7])
def test_stored_views_come_back_exactly(index):
    """Every correction vanishes where there is nothing to correct."""
    made = lobed([(coated, 0.2, schlick), (mirror_sphere, 0.0, np.ones_like)])
    frame = view_frame(made.viewpoints.directions[index])
    truth = coated(frame, N) + mirror_sphere(frame, N)
    assert np.abs(image(made, frame, N) - truth)[inside(N, 0.99)].max() < 1e-3


def test_lobes_are_warped_apart():
    """A matte lobe follows the normal, a glossy one the mirror direction; together neither warp alone would do."""

    def matte(frame, n):
        return sky(normals(frame, n)).astype(np.float32)

    frame = view_frame([0.3, 0.4, -0.8])
    made = lobed([(matte, 0.0, np.ones_like), (coated, 0.001, schlick)])
    truth = matte(frame, N) + coated(frame, N)
    error = np.abs(image(made, frame, N) - truth)[inside(N, 0.95)].mean()
    single = np.abs(image(method(lambda f, n: matte(f, n) + coated(f, n)), frame, N) - truth)[inside(N, 0.95)].mean()
    assert error < 0.1 * single


def test_a_constant_field_stays_constant(rng):
    """Hard case 7 for the lobed method: nothing is divided out that is not put back."""
    made = lobed([(lambda _, n: np.ones((n, n, 3), np.float32), 0.1, np.ones_like)])
    for view in unit_vectors(rng, 4):
        assert np.abs(image(made, view_frame(view), N)[inside(N)] - 1).max() < 1e-6


def test_footprints_differ_as_their_covariances_do(rng):
    """ΔM against its definition, aaᵀ + cos²θ bbᵀ of the destination less that of the source, in float64."""
    n, stored = unit_vectors(rng, 200), unit_vectors(rng, 200)
    n[:, 2] = np.abs(n[:, 2]) * 0.9 + 0.05
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    r = 2 * n[:, 2:] * n - [0, 0, 1]
    stored_cosine = np.sqrt((1 + (r * stored).sum(1)) / 2)

    def covariance(v, cosine):
        a = v - (v * r).sum(1, keepdims=True) * r
        a /= np.linalg.norm(a, axis=1, keepdims=True)
        b = np.cross(r, a)
        return a[:, :, None] * a[:, None, :] + (cosine**2)[:, None, None] * b[:, :, None] * b[:, None, :]

    wanted = covariance(np.tile([0.0, 0.0, 1.0], (200, 1)), n[:, 2]) - covariance(stored, stored_cosine)
    axes = MirrorFootprint.at(vector(n)).axes_toward(vector(stored), stored_cosine.astype(np.float32))
    got = sum(
        to_numpy(value)[:, None, None] * (to_numpy(e).T[:, :, None] * to_numpy(e).T[:, None, :]) for e, value in axes
    )
    assert np.abs(got - wanted).max() < 5e-5


def test_a_footprint_is_changed_by_half_its_covariance_times_the_curvature(rng):
    """½ 4σ² ΔM : ∇∇L of L = 2 + (r·u)², whose Hessian on the sphere is 2 (uₜuₜᵀ − (r·u)² 1), in float64."""
    u, alpha, size = np.array([0.36, 0.48, 0.8]), 0.1, 256
    view, index = view_frame([0.2, 0.5, 0.8]), 5

    def reflections(frame, resolution):
        n = normals(frame, resolution)
        return 2 * (n @ frame[:, 2])[..., None] * n - frame[:, 2]

    made = lobed(
        [
            (
                lambda f, k: np.repeat(2 + (reflections(f, k) @ u)[..., None] ** 2, 3, axis=-1).astype(np.float32),
                alpha,
                np.ones_like,
            )
        ],
        size,
    )
    lobe, stored_v = made.groups[0].lobes[0], view.T @ made.viewpoints.directions[index]
    # Normals in the new view's frame at which both views see the surface well
    n = unit_vectors(rng, 4000)
    r = 2 * n[:, 2:] * n - [0, 0, 1]
    stored_cosine = np.sqrt((1 + r @ stored_v) / 2)
    n, r, stored_cosine = (values[(n[:, 2] > 0.5) & (stored_cosine > 0.5)] for values in (n, r, stored_cosine))
    assert len(n) > 200

    def footprint(v, cosine):
        a = v - (r @ v)[:, None] * r
        a /= np.linalg.norm(a, axis=1, keepdims=True)
        b = np.cross(r, a)
        return a[:, :, None] * a[:, None, :] + (cosine**2)[:, None, None] * b[:, :, None] * b[:, None, :]

    change = footprint(np.array([0.0, 0.0, 1.0]), n[:, 2]) - footprint(stored_v, stored_cosine)
    local = view.T @ u
    flat = local - (r @ local)[:, None] * r
    hessian = 2 * (flat[:, :, None] * flat[:, None, :] - ((r @ local) ** 2)[:, None, None] * np.eye(3))
    wanted = 0.5 * 4 * HALF_VECTOR_VARIANCE * alpha**2 * np.einsum("kij,kij->k", change, hessian)

    stored = lobe.sources.view(mi.UInt32(index))
    mirror = MirrorWarp.between(stored, mi.Matrix3f(view.astype(np.float32)))
    device = vector(n)
    p, _ = mirror(device)
    seen = lobe.sources.fetch(stored.index, p)
    cosine = dr.sqrt(1 - dr.squared_norm(p))
    corrected = _footprint_corrected(lobe, stored.index, mirror, MirrorFootprint.at(device), cosine, seen)
    got = to_numpy(corrected - seen)[0]
    assert (got @ wanted) / (wanted @ wanted) == pytest.approx(1, abs=0.05)
    assert np.abs(got - wanted).max() < 0.1 * np.abs(wanted).max()


def test_finite_everywhere_near_stored_views_and_antipodes():
    made = lobed([(coated, 0.15, schlick), (mirror_sphere, 0.0, np.ones_like)])
    for away in (0, 1e-7, 1e-4, 1e-2):
        for sign in (1, -1):
            view = sign * made.viewpoints.directions[2] + away * np.array([0.3, -0.8, 0.52])
            got = image(made, view_frame(view), N)
            assert np.isfinite(got).all()
            assert (got >= 0).all()


def test_eval_agrees_with_the_map():
    made, frame = lobed([(coated, 0.1, schlick)]), view_frame([0.2, -0.6, 0.7])
    n = normals(frame, N).reshape(-1, 3)
    got = to_numpy(made.eval(vector(n), vector(np.tile(frame[:, 2], (len(n), 1))))).T.reshape(N, N, 3)
    assert np.abs(got - image(made, frame, N))[inside(N, 0.99)].max() < 1e-3


def test_a_bake_without_lobes_is_refused_with_the_remedy(tmp_path, asymmetric_environment):
    config = tmp_path / "c.toml"
    config.write_text(f'[environment]\nfile="{asymmetric_environment}"\n[material]\npreset="glossy-plastic"\n')
    small = ["map.resolution=16", "sampling.samples=8"]
    without = bake(config, out=tmp_path / "a.rsibr", overrides=[*small, 'effects.lobes="off"'])
    with pytest.raises(BakeError, match=r"effects\.lobes"):
        reconstruct(without, (1, 2, 3), method="rsibr")
    assert list(without.map(0).layers) == ["radiance"]
    apart = bake(config, out=tmp_path / "b.rsibr", overrides=small)
    assert np.isfinite(reconstruct(apart, (1, 2, 3), method="rsibr").image).all()
    assert [lobe.name for lobe in apart.manifest.lobes] == list(apart.map(0).layers)
    assert MethodSet(apart)["rsibr"].cost.bytes == apart.bytes
