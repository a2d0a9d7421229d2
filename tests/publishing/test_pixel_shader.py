"""Shaders of pixels that each have a view of their own, against the library's `eval`, for a sphere in perspective."""

import mitsuba as mi
import numpy as np
import pytest

from rsibr.geometry.frame import view_frame
from rsibr.methods.method_set import MethodSet
from rsibr.publishing.bundle import bundle_of
from tests.publishing.engine_page import engine_page

SIDE = 48
MIDDLE = [0.3, -0.5, 0.8]

PIXELS = """([method, middle, n, v, side]) => {
  const { gl, gpu } = engine, shader = engine.pixelShader(method), program = gl.createProgram();
  const vertex = `#version 300 es
    void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;
  const fragment = `#version 300 es
    ${shader.glsl}
    uniform sampler2D pageN, pageV;
    out vec4 pageColour;
    void main() {
      ivec2 at = ivec2(gl_FragCoord.xy);
      pageColour = vec4(radiance(texelFetch(pageN, at, 0).xyz, texelFetch(pageV, at, 0).xyz), 1.0);
    }`;
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const one = gl.createShader(kind);
    gl.shaderSource(one, text);
    gl.compileShader(one);
    gl.attachShader(program, one);
    if (!gl.getShaderParameter(one, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(one));
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const [pageN, pageV] = [n, v].map((numbers) => {
    const texture = gpu.texture(side, side, "RGBA32F");
    gpu.upload(texture, Float32Array.from(numbers));
    return texture;
  });
  const target = gpu.texture(side, side, "RGBA32F");
  shader.update(middle);
  gpu.draw(gpu.described(program), target, {}, { bind: (one) => gpu.set(one, { pageN, pageV }, shader.bind(program)) });
  return gpu.read(target);
}"""


def sphere(middle, field_of_view_deg):
    """Unit normals and views (SIDE, SIDE, 3) of a unit sphere that fills a picture, and where it is seen."""
    frame = view_frame(middle)
    reach = np.tan(np.radians(field_of_view_deg / 2))
    eye = frame[:, 2] / np.sin(np.radians(field_of_view_deg / 2))
    place = (np.arange(SIDE) + 0.5) / SIDE * 2 - 1
    x, y = np.meshgrid(place * reach, -place * reach)
    ray = x[..., None] * frame[:, 0] + y[..., None] * frame[:, 1] - frame[:, 2]
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    along = ray @ eye
    root = along**2 - (eye @ eye - 1)
    n = eye + ray * (-along - np.sqrt(np.maximum(root, 0)))[..., None]
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    seen = (root > 0) & (-(n * ray).sum(axis=-1) > 0.02)
    fill = seen[..., None]
    return np.where(fill, n, frame[:, 2]), np.where(fill, -ray, frame[:, 2]), seen


def error(page, method, name, middle, field_of_view_deg):
    """RelMSE of the page's pixels over those where the sphere is seen."""
    n, v, seen = (np.float32(one) for one in sphere(middle, field_of_view_deg))
    four = [np.pad(one, ((0, 0), (0, 0), (0, 1))).ravel().tolist() for one in (n, v)]
    found = page.numbers(PIXELS, name, list(map(float, middle)), *four, SIDE).reshape(-1, 3)[seen.ravel() > 0]
    wanted = np.array(method.eval(*(mi.Vector3f(one.reshape(-1, 3).T) for one in (n, v)))).T[seen.ravel() > 0]
    a, b = found.astype(np.float64), wanted.astype(np.float64)
    return ((a - b) ** 2 / (b**2 + (0.1 * b.mean(axis=0)) ** 2)).mean()


EXACT = "nearest", "blend", "cabral1999", "miller1984", "kautz2003", "split-sum"


@pytest.mark.slow
def test_pixels_are_shaded_as_by_the_library(browser, baked, tmp_path):
    """In perspective of 40° and, for `rsibr`, of 20°.

    It takes the light of narrow and wide Gaussians from one middle view, where the library integrates a footprint a
    pixel.
    """
    bake = baked("clearcoat-red", 48, 64)
    methods = MethodSet(bake)
    bundle = bundle_of(bake, precision="float", methods=[*EXACT, "rsibr"], sizes=(48,))
    with engine_page(browser, bundle, tmp_path) as page:
        for name in EXACT:
            assert error(page, methods[name], name, MIDDLE, 40) < 1e-8, name
        for field, bound in ((20, 2e-3), (40, 4e-3)):
            assert error(page, methods["rsibr"], "rsibr", MIDDLE, field) < bound, field
