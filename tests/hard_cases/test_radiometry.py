"""Hard cases 16 to 23: furnaces, closed forms, lobes of every width, and what one warp cannot do."""

import math
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from rsibr.baking.baker import bake
from rsibr.baking.blocks import Blocks, block_sizes
from rsibr.baking.integrator import EstimateOptions, Launch, SphereIntegrator
from rsibr.baking.lattice import ShiftedLattice
from rsibr.baking.view import bake_view
from rsibr.geometry.frame import view_frame
from rsibr.lobes.bsdf_eval import RETRO_RATIO, retro_ratio
from rsibr.methods.warp_blend.blend import nearest_mix
from rsibr.methods.warp_blend.warp import WARPS, MirrorWarp
from rsibr.scene.config import EnvironmentConfig, MaterialConfig
from rsibr.scene.environment import load_environment
from rsibr.scene.material import load_material
from rsibr.scene.presets import PRESETS
from rsibr.store.health import map_health
from rsibr.validation.flip import exposures_for
from rsibr.validation.metrics import compare
from rsibr.validation.reference import Reference
from tests.arrays import disk_grid, to_numpy
from tests.baking.test_integrator import FURNACE, disk_area_moments
from tests.methods.scene import image, inside, matte_sphere, method, mirror_sphere, normals, sky
from tests.validation.doubles import disk

N = 32
MIRROR = {"type": "conductor", "material": "none"}
VIEWS = [[1, 2, 3], [0, 1, 0], [-0.3, 0.2, -0.9]]


def integrator(bsdf, emitter=FURNACE, resolution=N):
    return SphereIntegrator(emitter, mi.load_dict(bsdf), resolution)


@pytest.mark.parametrize("samples", [2, 5, 16])
def test_hc16_white_furnace_of_a_perfect_mirror(samples):
    """1 ± 1e-5 in every texel, the rim's too, whatever the samples.

    Fails when samples of a texel at the rim miss the sphere: mutant hc16.
    """
    means = integrator(MIRROR, resolution=64).block(view_frame([1, 2, 3]), samples, np.random.SeedSequence(samples))
    assert np.abs(means - 1).max() < 1e-5


def test_hc16_white_furnace_of_a_mirror_above_a_matte_base():
    """The light is sampled for the base, and cannot find the mirror: the sum is what samples of the BSDF alone give.

    2^18 samples each, a relative standard error of 0.4 %: 3 % is beyond 5σ. Sharing the weight would lose a fifth.
    Fails when a delta lobe shares its weight with a light that cannot sample it: mutant hc16.
    """
    bsdf, lanes = mi.load_dict({"type": "plastic", "diffuse_reflectance": 0.1}), 2**18
    n = dr.repeat(mi.Vector3f(0, 0, 1), lanes)
    both, alone = (
        to_numpy(
            SphereIntegrator(FURNACE, bsdf, N, options=EstimateOptions(light_samples=on))._reflected(
                n, n, independent(lanes, 1)
            )
        ).mean()
        for on in (True, False)
    )
    assert both == pytest.approx(alone, rel=0.03)


def independent(lanes, seed):
    """Independent samples: lattices of one point each."""
    return ShiftedLattice(1, dr.arange(mi.UInt32, lanes), mi.UInt32(0), dr.opaque(mi.UInt32, seed))


@pytest.mark.parametrize(("alpha", "albedo"), [(1.0, 0.30685), (0.5, 0.68785), (0.3, 0.87736), (0.1, 0.9883)])
def test_hc17_ggx_albedo_at_normal_incidence(alpha, albedo):
    """F = 1 in a white furnace, n = v in every lane: within 3σ of the closed form, 1 − ln 2 at α = 1.

    2^20 samples in 64 independent blocks. 3σ raise a false alarm in 0.3 % of seeds; this seed is fixed. The samples'
    scatter is below 1e-3 of the albedo, so that a weight counted twice cannot hide.
    Fails when the samples of the light and of the BSDF are not weighted for each other: mutant hc17.
    """
    made = integrator({"type": "roughconductor", "material": "none", "alpha": alpha, "distribution": "ggx"})
    lanes, blocks = 2**20, 64
    up = dr.repeat(mi.Vector3f(0, 0, 1), lanes)
    means = to_numpy(made._reflected(up, up, independent(lanes, int(100 * alpha))))[0].reshape(blocks, -1).mean(axis=1)
    error = means.std(ddof=1) / np.sqrt(blocks)
    assert error < 1e-3 * albedo
    assert abs(means.mean() - albedo) < 3 * error + 5e-5  # the last digit of the table


@pytest.mark.parametrize("view", [[0.5, 0.6, -0.7], [0, 1, 0]])
def test_hc18_lambert_under_a_gradient_has_the_irradiance_of_the_closed_form(view, gradient_sky, gradient_axis):
    """Irradiance π + (2π/3) a·n under 1 + a·ω, by three tests of t = (mean − exact)/error a texel.

    The largest |t| by Šidák's bound, Student's t with 15 degrees of freedom; the aggregate Σt/√N, which sees a small
    global bias; and Σt² against its mean and spread, which sees a variance that is not the variance. False-alarm rate
    1e-4 each.
    Fails when the map's frame is transposed, or the variance is not that of the mean: mutants hc18.
    """
    emitter = load_environment(EnvironmentConfig(file=gradient_sky)).emitter()
    frame = view_frame(view)
    baked = bake_view(
        integrator({"type": "diffuse", "reflectance": 0.5}, emitter), frame, Blocks(64, 16), seed=3, index=0
    )
    x, y = disk_grid(N)
    mean_normal = np.stack(disk_area_moments((x - 1 / N, y + 1 / N), 2 / N), axis=-1) @ frame.T
    irradiance = np.pi + 2 * np.pi / 3 * mean_normal @ gradient_axis
    judged = baked.coverage > 0.05  # below, the midpoint sums err more than the noise
    error = np.sqrt(baked.variance[..., 0][judged])
    t = (baked.layers["radiance"][..., 0][judged] - 0.5 / np.pi * irradiance[judged]) / error
    count = len(t)
    assert 2 * student.sf(np.abs(t).max(), 15) > 1 - (1 - 1e-4) ** (1 / count)
    assert 2 * norm.sf(abs(t.sum()) / np.sqrt(count * 15 / 13)) > 1e-4
    second, fourth = 15 / 13, 3 * 15**2 / (13 * 11)  # moments of Student's t
    assert 2 * norm.sf(abs((t**2).sum() - count * second) / np.sqrt(count * (fourth - second**2))) > 1e-4


def legendre(band, x):
    return np.polynomial.legendre.Legendre.basis(band)(x)


def band_factors(exponent, bands):
    """Λ_l of the lobe (n+1)/2π cosⁿ about its centre, by the recurrence."""
    factors = [1.0, (exponent + 1) / (exponent + 2)]
    for band in range(2, bands):
        factors.append(factors[band - 2] * (exponent + 2 - band) / (exponent + 1 + band))
    return factors[:bands]


@pytest.mark.parametrize("exponent", [1, 10, 100])
def test_hc19_one_warped_map_of_a_phong_lobe_serves_every_view(exponent):
    """A lobe about the mirror direction scales each band of the sky by Λ_l, and the map depends on r alone.

    The bands' factors by recurrence are those of quadrature; the map of one stored view, warped, is the closed form at
    other views, to the bilinear lookup, within the part of the disk that maps into the stored view's.
    Fails when the mirror warp does not halve the angle between the views: mutant hc19.
    """
    factors = band_factors(exponent, 4)
    x, weight = np.polynomial.legendre.leggauss(200)
    x, weight = (x + 1) / 2, weight / 2
    assert factors == pytest.approx([(exponent + 1) * (weight * x**exponent * legendre(b, x)).sum() for b in range(4)])

    axes = np.array([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0], [-0.48, 0.64, 0.6]])

    def convolved(r):
        return np.stack(
            [1.5 + sum(f * legendre(b + 1, r @ a) / 4 for b, f in enumerate(factors[1:])) for a in axes], -1
        )

    def phong_sphere(frame, resolution):
        n, v = normals(frame, resolution), frame[:, 2]
        return convolved(2 * (n @ v)[..., None] * n - v).astype(np.float32)

    made = method(phong_sphere, 128, mix=nearest_mix, warp=MirrorWarp)
    for view in VIEWS:
        frame = view_frame(view)
        error = np.abs(image(made, frame, N) - phong_sphere(frame, N))
        n, v = normals(frame, N), frame[:, 2]
        r = 2 * (n @ v)[..., None] * n - v
        stored = made.viewpoints.directions[np.argmax(made.viewpoints.directions @ v)]
        assert error[inside(N) & (r @ stored > -0.6)].max() < 0.01


def test_hc20_lambert_warped_by_reflection_is_wrong_and_less_so_with_more_views():
    """The negative control: an error that is there at level 0 and falls with the level, by more than half each.

    Fails when the mirror warp is not the mirror warp: mutant hc20.
    """
    errors = []
    for level in (0, 1, 2):
        made = method(matte_sphere, N, warp=WARPS["mirror"], subdivision=level)
        maps = [(image(made, f, N), matte_sphere(f, N)) for f in map(view_frame, VIEWS)]
        errors.append(np.mean([np.abs(got - exact)[inside(N, 0.9)].mean() for got, exact in maps]))
    assert errors[0] > 0.01
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


NARROW = [
    {"type": "roughconductor", "material": "none", "alpha": 1e-6},
    {"type": "roughconductor", "material": "none", "alpha": 1e-4},
    {"type": "principled", "metallic": 1.0, "base_color": {"type": "rgb", "value": 1.0}, "roughness": 0.0},
    {"type": "principled", "metallic": 1.0, "base_color": {"type": "rgb", "value": 1.0}, "roughness": 1e-4},
    MIRROR,
]


@pytest.mark.parametrize("bsdf", NARROW, ids=["1e-6", "1e-4", "principled 0", "principled 1e-4", "delta"])
def test_hc21_narrow_lobes_agree_with_the_mirror(bsdf, gradient_sky, gradient_axis):
    """No NaN to the rim; within the disk the closed form of the mirror under 1 + a·ω, to the map's resolution.

    A texel's reflections spread over 4/N rad about its centre's: under |a| = 0.7 less than 0.1 either way, and 3σ.
    Fails when the BSDF is not sampled: mutant hc21.
    """
    emitter = load_environment(EnvironmentConfig(file=gradient_sky)).emitter()
    frame = view_frame([0.2, 0.5, 0.8])
    baked = bake_view(integrator(bsdf, emitter), frame, block_sizes(64), seed=1, index=0)
    got = baked.layers["radiance"]
    assert np.isfinite(got).all()
    assert np.isfinite(baked.variance).all()
    n, v = normals(frame, N), frame[:, 2]
    exact = 1 + (2 * (n @ v)[..., None] * n - v) @ gradient_axis
    judged = inside(N, 0.8)
    assert np.abs(got[..., 0] - exact)[judged].max() < 0.1
    assert np.abs(got[..., 0] - exact)[judged].mean() < 0.005


def retroreflector(frame, resolution):
    """What shines back along the view, over the normal's part of the sky: no warp of ours stands for it."""
    return (sky(frame[:, 2]) * (0.2 + (normals(frame, resolution) @ frame[:, 2])[..., None])).astype(np.float32)


def judged_error(sphere, frame, warp):
    made = method(sphere, N, warp=warp)
    truth = sphere(frame, N)
    reference = Reference(np.stack([truth] * 8), disk(N), samples=8, seconds=1.0)
    return compare(image(made, frame, N), reference, exposures_for(1.0))


@pytest.mark.parametrize("warp", WARPS)
def test_hc22_a_retroreflector_shows_its_larger_error_and_no_nan(warp):
    """Under either warp its relMSE is ten times a fitting lobe's or more; every number is finite, at stored views too.

    Fails when a lone source's confidence may vanish, or errors are clamped: mutants hc22.
    """
    fitting = {"mirror": mirror_sphere, "normal": matte_sphere}[warp]
    for view in VIEWS:
        frame = view_frame(view)
        wrong, right = (judged_error(sphere, frame, WARPS[warp]) for sphere in (retroreflector, fitting))
        assert wrong.rel_mse.value > 10 * right.rel_mse_zones["inner"].value
        assert wrong.rel_mse.value > 1e-3
        assert np.isfinite([wrong.rel_mse.value, wrong.smape, wrong.flip, wrong.energy_ratio]).all()
    made = method(
        retroreflector, 33, warp=WARPS[warp]
    )  # odd: a texel centre lies on the view, where mirrors retroreflect
    assert np.isfinite(image(made, view_frame(made.viewpoints.directions[4]), 33)[inside(33)]).all()


def test_hc22_a_retroreflective_lobe_is_flagged(tmp_path, asymmetric_environment):
    """Of all presets and a paint with a retroreflective part, the latter alone; the manifest of its bake says so.

    Fails when light that goes back is not looked for: mutant hc22 (light that goes back).
    """
    paint = load_material(MaterialConfig(bsdf={"type": "rsibr_car_paint", "retro_share": 0.5}))
    presets = {name: load_material(MaterialConfig(preset=name)).bsdf() for name in PRESETS}
    flagged = [name for name, bsdf in presets.items() if retro_ratio(bsdf) > RETRO_RATIO]
    assert retro_ratio(paint.bsdf()) > RETRO_RATIO
    assert flagged == []
    config = tmp_path / "retro.toml"
    config.write_text(
        f'[environment]\nfile="{asymmetric_environment}"\n[material.bsdf]\ntype="rsibr_car_paint"\nretro_share=0.5\n'
        "[map]\nresolution=8\n[sampling]\nsamples=4\n"
    )
    assert "retroreflective" in bake(config, out=tmp_path / "b.rsibr").manifest.material.notes[0]


def test_hc22_an_anisotropic_lobe_is_flagged(tmp_path, asymmetric_environment):
    """In the material, in the manifest of its bake, and from there in the report.

    Fails when the flag is not asked for: mutant hc22 (flag).
    """
    brushed = {"type": "roughconductor", "alpha_u": 0.05, "alpha_v": 0.3}
    assert "anisotropic" in load_material(MaterialConfig(bsdf=brushed)).notes[0]
    assert load_material(MaterialConfig(preset="rough-aluminium")).notes == ()
    config = tmp_path / "brushed.toml"
    config.write_text(
        f'[environment]\nfile="{asymmetric_environment}"\n[material.bsdf]\ntype="roughconductor"\nalpha_u=0.05\n'
        "alpha_v=0.3\n[map]\nresolution=8\n[sampling]\nsamples=4\n"
    )
    assert "anisotropic" in bake(config, out=tmp_path / "b.rsibr").manifest.material.notes[0]


def test_hc22_an_anisotropic_lobe_bakes_finite(asymmetric_environment):
    """Brushed metal: every texel finite and lit; Mitsuba says that it is anisotropic, which a plan can go by.

    Fails when the surface has no frame of its own: mutant hc22.
    """
    material = load_material(MaterialConfig(bsdf={"type": "roughconductor", "alpha_u": 0.05, "alpha_v": 0.4}))
    assert mi.has_flag(material.bsdf().flags(), mi.BSDFFlags.Anisotropic)
    emitter = load_environment(EnvironmentConfig(file=asymmetric_environment)).emitter()
    made = SphereIntegrator(emitter, material.bsdf(), N)
    baked = bake_view(made, view_frame([0.2, 0.5, 0.8]), block_sizes(64), seed=1, index=0)
    got = baked.layers["radiance"][baked.coverage > 0]
    assert np.isfinite(got).all()
    assert (got > 0).all()


CLEARCOAT = {"type": "principled", "roughness": 0.0, "clearcoat": 1.0, "clearcoat_gloss": 1.0, "specular": 1.0}


def test_hc23_grazing_samples_of_a_clear_coat_are_finite_and_not_clamped():
    """At cos θ = 1e-6 a sample may weigh 94: in a furnace of radiance 1e4 such samples come through whole.

    What is seen of the light is at most what its samples would be alone; so the largest must exceed the furnace.
    Fails when a sample's radiance is clamped: mutant hc23.
    """
    radiance = 1e4
    made = integrator(CLEARCOAT, {"type": "constant", "radiance": {"type": "rgb", "value": radiance}})
    lanes = 2**16
    cosine = 1e-6
    v = dr.repeat(mi.Vector3f(math.sqrt(1 - cosine**2), 0, cosine), lanes)
    got = to_numpy(made._reflected(dr.repeat(mi.Vector3f(0, 0, 1), lanes), v, independent(lanes, 1)))
    assert np.isfinite(got).all()
    assert got.max() > 5 * radiance


def test_hc23_outliers_are_counted_and_reported(tmp_path):
    """A map with two texels that a single block has lit: both are counted for its manifest, and left as they are.

    Fails when fireflies are not looked for: mutant hc23 (counted).
    """
    made = integrator(MIRROR, resolution=N)
    sound = bake_view(made, np.eye(3), Blocks(4, 16), seed=0, index=0)
    image, variance = sound.layers["radiance"].copy(), np.full_like(sound.variance, 1e-6)
    for row, column in ((16, 16), (9, 20)):
        image[row, column], variance[row, column] = 60.0, 60.0**2
    found = map_health(replace(sound, layers={"radiance": image}, variance=variance))
    assert found.record().fireflies == 2
    assert image.max() == 60.0


def test_hc23_an_outlier_of_a_block_reaches_the_map_and_its_variance(monkeypatch):
    """One block of sixteen with 1e15 in a texel: mean and variance hold it, whatever it is.

    Fails when the mean of the blocks is clamped: mutant hc23.
    """
    made = integrator(MIRROR, resolution=8)
    covered = int((made.coverage > 0).sum())

    def launch(frame, texels, samples, seed):
        means = np.ones(len(texels), dtype=np.float32)
        means[20 * 16 + 7] = 1e15
        return Launch([[mi.Float(means)] * 3])

    monkeypatch.setattr(made, "launch", launch)
    baked = bake_view(made, np.eye(3), Blocks(4, 16), seed=0, index=0)
    expected = (1e15 + 15) / 16
    assert baked.layers["radiance"].max() == pytest.approx(expected, rel=1e-6)
    assert baked.variance.max() == pytest.approx(expected**2, rel=1e-6)
    assert (baked.layers["radiance"][baked.coverage > 0] == 1).sum() == 3 * (covered - 1)
