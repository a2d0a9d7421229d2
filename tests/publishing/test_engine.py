"""The engine in a real browser: decoding, frames, triangles, memory, lost contexts, refusals."""

import re

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import unit_view, view_frame
from rsibr.light.environment_pyramid import EnvironmentPyramid
from rsibr.publishing.bundle import bundle_of
from rsibr.publishing.bundle.bundle import Bundle
from rsibr.publishing.bundle.encoding import encoded, encoded_images
from tests.arrays import unit_vectors
from tests.publishing.engine_page import columns, engine_page, relative_error


@pytest.fixture(scope="module")
def page(browser, baked, tmp_path_factory):
    """The page of a small bake, with half numbers and the methods that are quick."""
    bundle = bundle_of(baked("rough-aluminium"), methods=["nearest", "blend", "cabral1999"], sizes=(48,), light_size=64)
    with engine_page(browser, bundle, tmp_path_factory.mktemp("page")) as opened:
        yield opened


def test_arrays_come_back_to_the_last_bit(page, rng):
    image = rng.lognormal(0, 3, (7, 5, 3)).astype(np.float32)
    image[2, 2] = 3e5, 0, 1
    arrays = {
        "half": encoded_images(image, "half"),
        "float": encoded_images(image, "float"),
        "short": encoded(np.arange(-5, 5, dtype=np.int16)),
        "uint": encoded(np.array([0, 7, 2**32 - 1], np.uint32)),
    }
    text = Bundle({"format": 1, "methods": []}, arrays).to_script("other")
    found = page.ask(
        """async ([text]) => {
          const host = document.createElement("div");
          host.innerHTML = text;
          const { arrays } = await rsibr.decodeBundle(host.firstChild);
          return Object.fromEntries(Object.entries(arrays).map(([name, one]) =>
            [name, { shape: one.shape, numbers: Array.from(rsibr.numbers(one)) }]));
        }""",
        text,
    )
    planes = np.moveaxis(image, -1, 0)
    assert found["half"]["shape"] == [3, 7, 5]
    scale = arrays["half"].scale
    kept = (planes / scale).astype(np.float16).astype(np.float64) * scale
    assert np.array_equal(np.reshape(found["half"]["numbers"], (3, 7, 5)), kept)
    assert np.array_equal(np.reshape(found["float"]["numbers"], (3, 7, 5)), planes)
    assert found["short"]["numbers"] == list(range(-5, 5))
    assert found["uint"]["numbers"] == [0, 7, 2**32 - 1]


def test_frames_are_the_library_s(page, rng):
    for view in [*unit_vectors(rng, 8), [0, 1, 0], [0, -1, 0], [0, 0, 5.0]]:
        found = page.numbers("([view]) => engine.frame(view)", np.asarray(view, float).tolist())
        assert np.array_equal(found, np.float32(columns(view_frame(unit_view(view))))), view


def test_triangles_are_the_library_s(page, baked, rng):
    bake = baked("rough-aluminium")
    views = page.numbers("() => engine.views").reshape(-1, 3)
    assert np.allclose(views, bake.directions, atol=1e-7)
    for view in unit_vectors(rng, 20):
        found = page.ask("([view]) => engine.triangle(view)", view.tolist())
        corners = bake.directions[found["views"]]
        assert (np.linalg.inv(corners.T) @ view > 0).all()
        assert sum(found["weights"]) == pytest.approx(1)
    assert page.ask("() => engine.triangles.length") == 60


def test_the_background_is_the_environment(page, baked):
    """Latitude and longitude in Mitsuba's convention, from the reduced light."""
    size = page.ask("() => [engine.environment.width, engine.environment.height]")
    assert size == [256, 128]
    found = page.numbers("() => engine.gpu.read(engine.environment)").reshape(128, 256, 3)
    polar, turn = np.pi * np.arange(128) / 127, 2 * np.pi * (np.arange(256) + 0.5) / 256
    d = np.stack(np.broadcast_arrays(np.sin(polar)[:, None] * np.sin(turn), np.cos(polar)[:, None], 0.0), axis=-1)
    d[..., 2] = -np.sin(polar)[:, None] * np.cos(turn)
    picture = baked("rough-aluminium").light.picture.reshape(64, 8, 64, 8, 3).mean(axis=(1, 3))
    light = EnvironmentPyramid.finest_only(np.float32(picture))
    wanted = np.array(light.fetch(mi.Vector3f(np.float32(d.reshape(-1, 3).T)), mi.UInt32(0))).T.reshape(128, 256, 3)
    assert relative_error(found, wanted, np.ones((128, 256))) < 1e-4


def test_mip_levels_keep_the_rim_bright(page):
    """Level 3 of a map that is white all over, from a map extended beyond the disk."""
    inside = page.ask(
        """([frame]) => {
          const map = engine.map("nearest", frame, 48), { gl, gpu } = engine;
          const framebuffer = gl.createFramebuffer(), pixels = new Float32Array(4 * 36);
          gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
          gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, map.texture, 3);
          gl.readPixels(0, 0, 6, 6, gl.RGBA, gl.FLOAT, pixels);
          gl.bindFramebuffer(gl.FRAMEBUFFER, null);
          return [map.levels, Array.from(pixels), Array.from(engine.read(map))];
        }""",
        columns(view_frame([0, 0, 1])),
    )
    levels, coarse, fine = inside
    assert levels == 6
    whole = np.reshape(fine, (48, 48, 3))
    means = whole.reshape(6, 8, 6, 8, 3).mean(axis=(1, 3))
    assert np.allclose(np.reshape(coarse, (6, 6, 4))[..., :3], means, rtol=5e-3)
    assert whole.min() > 0  # corners too


def test_a_lost_context_comes_back(page):
    frame = columns(view_frame([1, 2, 3]))
    before = page.map("cabral1999", view_frame([1, 2, 3]), 48)
    page.ask(
        """([frame]) => new Promise((done) => {
          const loss = engine.gl.getExtension("WEBGL_lose_context");
          canvas.addEventListener("webglcontextlost", () => {
            window.whileLost = engine.map("cabral1999", frame, 48);
            setTimeout(() => loss.restoreContext());
          }, { once: true });
          canvas.addEventListener("webglcontextrestored", () => done(), { once: true });
          loss.loseContext();
        })""",
        frame,
    )
    assert page.ask("() => window.whileLost") is None
    assert np.array_equal(page.map("cabral1999", view_frame([1, 2, 3]), 48), before)


def test_memory_is_what_the_textures_take(page):
    """Within a tenth: small tables are left out."""
    said, taken = page.ask(
        """([frame]) => {
          engine.environment;
          for (const method of engine.methods) engine.map(method, frame, 48);
          const wide = { RGBA16F: 8, RGBA32F: 16, RG16I: 4 };
          let taken = 0;
          for (const one of engine.gpu.textures) {
            if (one === engine.environment) continue;
            const mips = one.levels > 1 ? 4 / 3 : 1;
            taken += one.width * one.height * Math.max(one.layers, 1) * wide[one.format] * mips;
          }
          return [rsibr.memory(engine.bundle, 48), taken];
        }""",
        columns(view_frame([0, 0, 1])),
    )
    assert said == pytest.approx(taken, rel=0.1)


REFUSED = {
    "no WebGL2": "() => new rsibr.Engine(null, engine.bundle)",
    "keeps at most .* Export it from a bake of fewer views": (
        "() => new rsibr.Engine(engine.gl, {...engine.bundle, stored: {...engine.bundle.stored, views: 1e6}})"
    ),
    "texels a side, the page needs": (
        "() => new rsibr.Engine(engine.gl, {...engine.bundle, stored: {...engine.bundle.stored, resolution: 1e6}})"
    ),
    "no room for 2000 textures": "() => engine.gpu.texture(8000, 8000, 'RGBA32F', { layers: 2000 })",
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_is_said(message, page):
    found = page.ask(
        f"""() => {{
          try {{ ({REFUSED[message]})(); }} catch (error) {{ return [error.name, error.message]; }}
          return null;
        }}"""
    )
    assert found is not None
    assert found[0] == "Unsupported"
    assert re.search(message, found[1]), found


def test_a_bundle_of_another_format_is_refused(page):
    found = page.ask(
        """async () => {
          const tag = document.createElement("script");
          tag.textContent = '{"format": 99, "arrays": {}}';
          return rsibr.decodeBundle(tag).catch((error) => [error.name, error.message]);
        }"""
    )
    assert found == ["Unsupported", "This page holds data of format 99, its engine reads 1."]
