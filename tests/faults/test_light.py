"""Faults of light: lights without extent, and bakes that end in nothing.

Right values of the cases: a path tracer on rays of its own.
"""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

import rsibr
from rsibr import backend
from rsibr.baking.blocks import Blocks, estimate
from rsibr.baking.integrator import SphereIntegrator
from rsibr.errors import BakeError, CheckFailed, InputError
from rsibr.geometry.frame import view_frame
from rsibr.geometry.projections.sphere_map import texel_coverage
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.radiance import Light
from rsibr.methods import Needs, PointwiseMethod, register
from rsibr.methods.registry import available, unregister
from rsibr.scene import python_plugins
from rsibr.scene.config import load_config
from rsibr.store.bake import open_bake
from tests.cli.command import Shell
from tests.faults.cases import case

VIEW = (1, 2, 3)
SMALL = ["map.resolution=32", "sampling.samples=16"]

PLUGIN = '''
import drjit as dr
import mitsuba as mi


class Faulty(mi.BSDF):
    """Half of Lambert's, with one thing wrong."""

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        self.fault = properties["fault"]
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def sample(self, context, si, one, two, active=True):
        drawn = dr.zeros(mi.BSDFSample3f, dr.width(si))
        drawn.wo, drawn.eta = mi.warp.square_to_cosine_hemisphere(two), 1.0
        drawn.sampled_type, drawn.sampled_component = mi.UInt32(+mi.BSDFFlags.DiffuseReflection), 0
        drawn.pdf = self.pdf(context, si, drawn.wo)
        weight = {"sample": dr.nan, "rare": dr.select(two.x < 3e-4, dr.nan, 0.5)}.get(self.fault, 0.5)
        return drawn, mi.Color3f(weight)

    def eval(self, context, si, wo, active=True):
        factor = {"eval": dr.nan, "black": 0.0}.get(self.fault, 0.5)
        return mi.Color3f(factor * dr.maximum(wo.z, 0) * dr.inv_pi)

    def pdf(self, context, si, wo, active=True):
        return (0.0 if self.fault == "density" else 1.0) * dr.maximum(wo.z, 0) * dr.inv_pi

    def eval_pdf(self, context, si, wo, active=True):
        return self.eval(context, si, wo), self.pdf(context, si, wo)


mi.register_bsdf("faulty", Faulty)
'''


@pytest.fixture
def shell(monkeypatch, capsys):
    return Shell(monkeypatch, capsys)


@pytest.fixture
def faulty(tmp_path, monkeypatch):
    """Write the config of a faulty material under a constant sky; its plugin is forgotten at the end."""
    monkeypatch.setattr(python_plugins, "_modules", {})
    monkeypatch.setattr(backend, "_registrations", list(backend._registrations))
    monkeypatch.setattr(backend, "_registered", dict(backend._registered))

    def written(fault):
        (tmp_path / "faulty.py").write_text(PLUGIN)
        path = tmp_path / "config.toml"
        path.write_text(
            '[environment]\nemitter = {type = "constant"}\n'
            f'[material]\nbsdf = {{type = "faulty", fault = "{fault}"}}\n'
            "[map]\nresolution = 32\n[sampling]\nsamples = 16\n"
            '[plugins]\nmodules = ["faulty.py"]\n'
        )
        return path

    return written


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    """The bake of `directional_black`."""
    return rsibr.bake(case("directional_black"), out=tmp_path_factory.mktemp("beam") / "x.rsibr", overrides=SMALL)


@pytest.mark.slow
def test_directional_black(beam):
    """Every method shows the light, and the best ones the right amount: 0.237 over the disk."""
    disk = texel_coverage(32)
    for name in ("rsibr", "rsibr-fine"):
        image = rsibr.reconstruct(beam, VIEW, method=name).image
        assert (image.mean(axis=2) * disk).sum() / disk.sum() == pytest.approx(0.237, abs=0.002)
    report = rsibr.validate(beam, views=2, samples=64, methods=["cabral1999", "rsibr"], lobes=False)
    assert report.summary["rsibr"].rel_mse.value < 2e-3 < report.summary["cabral1999"].rel_mse.value


def test_directional_mirror_traceback(shell, tmp_path):
    """Nothing sees the light: one line before anything is rendered or written."""
    out = tmp_path / "x.rsibr"
    shell.refuses("bake", case("directional_mirror_traceback"), "--out", out, says="not seen in a perfect mirror")
    assert not (out / "manifest.json").exists()


def test_a_coloured_light_without_extent_is_not_baked_grey(tmp_path):
    """Of a kind with `directional_black`: what a picture of the light does not show, a plan must not miss."""
    emitter = {"type": "directional", "direction": [0, -1, -0.3], "irradiance": {"type": "rgb", "value": [3, 1, 0.2]}}
    scene = {"environment": {"emitter": emitter}, "material": {"bsdf": {"type": "diffuse"}}}
    baked = rsibr.bake({**scene, "map": {"resolution": 16}, "sampling": {"samples": 16}}, out=tmp_path / "x.rsibr")
    for image in (baked.map(0).radiance, rsibr.reconstruct(baked, VIEW).image):
        sums = image.sum(axis=(0, 1))
        assert sums / sums[0] == pytest.approx([1, 1 / 3, 0.2 / 3], rel=1e-3)


@pytest.mark.slow
def test_the_coat_of_a_plastic_is_said_not_to_show_the_light(tmp_path):
    emitter, plastic = {"type": "directional", "direction": [0, -1, 0]}, {"type": "plastic"}
    scene = {"environment": {"emitter": emitter}, "material": {"bsdf": plastic}, "map": {"resolution": 8}}
    baked = rsibr.bake({**scene, "sampling": {"samples": 4}}, out=tmp_path / "x.rsibr")
    assert any("without extent" in note for note in baked.manifest.material.notes)


def test_a_method_that_does_not_see_the_light_is_refused(beam):
    """It is in no table, and named it says why; one that needs no light, and one that sees it, are not."""

    @register("blind", summary="reads the picture of the light only", needs=Needs(light=True))
    class Blind(PointwiseMethod):
        pass

    try:
        assert "blind" not in available(beam)
        with pytest.raises(BakeError, match=r"without extent, which 'blind' does not see.*rsibr-fine"):
            rsibr.reconstruct(beam, VIEW, method="blind")
        with pytest.raises(BakeError, match="does not see"):
            rsibr.validate(beam, views=1, samples=8, methods=["blind"])
    finally:
        unregister("blind")
    assert {"cabral1999", "rsibr", "rsibr-fine"} < set(available(beam))


def test_a_bake_from_before_such_lights_were_stored_is_refused(beam):
    """Its light is black and its maps are not: a prediction from it would be black with exit 0."""
    light = beam.manifest.light.model_copy(update={"delta_lights": None})
    old = replace(beam, manifest=beam.manifest.model_copy(update={"light": light}))
    vars(old)["light"] = Light(beam.light.picture, delta=DeltaLights.none())
    with pytest.raises(BakeError, match=r"light that 'rsibr' predicts them from is black.*--fresh"):
        rsibr.MethodSet(old)["rsibr"]
    assert rsibr.MethodSet(old)["cabral1999"].name == "cabral1999"


@pytest.mark.parametrize(
    ("fault", "says"), [("sample", "100 % of the texels are not finite"), ("density", "all maps are black")]
)
def test_a_bake_of_no_use_ends_with_1_each_time_and_is_kept(shell, faulty, tmp_path, fault, says):
    """Also where it is found complete; nothing is reconstructed from it; `check` shows where."""
    config, out = faulty(fault), tmp_path / "x.rsibr"
    for _ in range(2):
        shell.refuses("bake", config, "--out", out, code=1, says=says)
    with pytest.raises(CheckFailed, match=says):
        rsibr.bake(load_config(config), out=out)
    assert open_bake(out).complete
    shell.refuses("reconstruct", out, "--view", "1,2,3", "--out", tmp_path / "x.exr", says=says)
    assert not (tmp_path / "x.exr").exists()


def test_a_material_that_is_not_a_number_is_refused(faulty, tmp_path):
    with pytest.raises(InputError, match=r"material: the BSDF is not finite at .* pairs of directions"):
        rsibr.bake(load_config(faulty("eval")), out=tmp_path / "x.rsibr")


def test_a_few_bad_texels_are_counted_and_the_rest_is_used(shell, faulty, tmp_path):
    ended = shell("bake", faulty("rare"), "--out", tmp_path / "x.rsibr")
    assert ended.code == 0
    assert "non-finite" in ended.stderr


@pytest.mark.parametrize(
    ("emitter", "material"),
    [
        ({"type": "constant"}, {"type": "diffuse", "reflectance": 0.0}),
        ({"type": "constant", "radiance": 0.0}, {"type": "diffuse"}),
        ({"type": "directional", "irradiance": 0.0}, {"type": "diffuse"}),
    ],
)
def test_black_maps_of_a_black_scene_are_right(tmp_path, emitter, material):
    scene = {"environment": {"emitter": emitter}, "material": {"bsdf": material}, "map": {"resolution": 8}}
    baked = rsibr.bake({**scene, "sampling": {"samples": 4}}, out=tmp_path / "x.rsibr")
    assert not rsibr.reconstruct(baked, VIEW).image.any()


def test_an_emitter_that_mitsuba_cannot_sample_is_refused(tmp_path):
    """`timed_sunsky` of Mitsuba 3.9.1: a traceback out of Dr.Jit in the middle of a bake."""
    scene = {"environment": {"emitter": {"type": "timed_sunsky"}}, "material": {"preset": "matte-lambert"}}
    with pytest.raises(InputError, match="cannot draw directions from 'timed_sunsky'"):
        rsibr.bake(scene, out=tmp_path / "x.rsibr")


def test_where_no_sample_is_lit_every_texel_is_there():
    """Of a kind with `directional_mirror_traceback`: an estimate that is a literal zero to Dr.Jit has one lane."""
    beam = {"type": "directional", "direction": [0, -1, -0.3]}
    integrator = SphereIntegrator(beam, mi.load_dict({"type": "conductor"}), 8)
    covered = int((integrator.coverage > 0).sum())
    mean, variance = estimate(integrator, view_frame(VIEW), Blocks(4, 2), np.random.SeedSequence(1))
    assert mean.shape == (covered, 1, 3)
    assert not mean.any()
    assert not variance.any()


@pytest.mark.slow
def test_the_noise_of_a_mirror_is_not_carried_to_a_new_view(tmp_path):
    """A smooth plastic under a sun that its coat shows by chance: nothing of it is added to the closed form."""
    emitter, plastic = {"type": "sunsky", "sun_direction": [0.3, 0.5, 0.6]}, {"type": "plastic"}
    scene = {"environment": {"emitter": emitter}, "material": {"bsdf": plastic}, "map": {"resolution": 16}}
    methods = rsibr.MethodSet(rsibr.bake({**scene, "sampling": {"samples": 4}}, out=tmp_path / "x.rsibr"))
    frame = view_frame([0.58, -0.58, 0.58])
    for name in ("rsibr", "rsibr-fine"):
        whole, base, closed = (
            np.array(made.map(frame, 16))[..., :3]
            for made in (
                methods[name],
                methods.variant(name, lobe="diffuse"),
                methods.variant(name, lobe="mirror"),
            )
        )
        assert whole - base == pytest.approx(closed, abs=5e-3 * float(closed.max()))
