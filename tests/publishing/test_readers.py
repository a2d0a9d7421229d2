"""Every format against a program that no one here wrote: six colours, and a mark on each face."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from rsibr.light.delta_lights import DeltaLights
from rsibr.light.radiance import Light
from rsibr.publishing.published_view import PublishedLight
from rsibr.publishing.registry import format_of
from tests.publishing import programs, six_colours
from tests.publishing.six_colours import FACES, MARK, MARKS, NO_MARKS, VIEW, at, places, seen

SIZE = 64


@pytest.fixture(scope="module")
def view():
    return six_colours.view()


def written(folder, subject, name, **options):
    """Files of a format, by ending."""
    files = {}
    for ending, data in format_of(name, options).encode(subject).files.items():
        files[ending] = folder / f"{subject.stem}.{ending}"
        files[ending].write_bytes(data)
    return files


def by_three(file, script="exr.mjs"):
    """Pixels by three.js, row 0 at the top, shape (H, W, 3)."""
    read = programs.node(script, file)
    pixels = np.array(read["data"], np.float32).reshape(read["height"], read["width"], -1)[..., :3]
    return pixels[::-1] if script == "exr.mjs" else pixels


# ---- Latitude–longitude ----------------------------------------------------------------------------------------------


def in_openexr(image):
    """Texels of the places by the formula in OpenEXR's ImfEnvmap.h: latitude and longitude of the outer centres."""
    d, expected = places()
    latitude, longitude = np.arcsin(d[:, 1]), np.arctan2(d[:, 0], d[:, 2])
    columns = (np.pi - longitude) / (2 * np.pi) * (image.shape[1] - 1)
    rows = (np.pi / 2 - latitude) / np.pi * (image.shape[0] - 1)
    return at(image, columns, rows), expected


def in_three(image):
    """Texels of the places by `equirectUv` of three.js's shaders: v upward, texels centred."""
    d, expected = places()
    u, v = np.arctan2(d[:, 2], d[:, 0]) / (2 * np.pi) + 0.5, np.arcsin(d[:, 1]) / np.pi + 0.5
    return at(image, u * image.shape[1] - 0.5, (1 - v) * image.shape[0] - 0.5), expected


def test_a_latlong_exr_lies_as_openexr_says(tmp_path, view):
    file = written(tmp_path, view, "latlong-exr", size=128)["latlong.exr"]
    header = programs.exrheader(file)
    assert "envmap (type envmap): latitude-longitude map" in header
    assert "Reflection of one view only" in header
    assert "view (type string)" not in header
    seen(*in_openexr(programs.pixels(file)))
    np.testing.assert_array_equal(by_three(file), programs.pixels(file))


def test_a_latlong_hdr_lies_as_three_js_looks_it_up(tmp_path, view):
    file = written(tmp_path, view, "latlong-hdr", size=128)["latlong.hdr"]
    assert b"Reflection of one view only" in file.read_bytes()[:1200]
    shader = programs.NODE / "node_modules/three/src/renderers/shaders/ShaderChunk/common.glsl.js"
    image = by_three(file, "hdr.mjs")
    assert "float u = atan( dir.z, dir.x ) * RECIPROCAL_PI2 + 0.5;" in shader.read_text()
    seen(*in_three(image))
    seen(*in_three(programs.pixels(file)))


def test_a_latlong_with_other_axes_bears_no_attribute(tmp_path, view):
    file = written(tmp_path, view, "latlong-exr", size=128, axes="latlong-three", half=True)["latlong.exr"]
    assert "envmap" not in programs.exrheader(file).replace("latlong", "")
    assert "16-bit floating-point" in programs.exrheader(file)
    seen(*in_three(programs.pixels(file)))


# ---- Sphere maps -----------------------------------------------------------------------------------------------------


def on_the_ball(image, frame):
    """Texels of the places in a picture of a mirror ball: the half vector, x right and y up."""
    d, expected = places()
    half = (d + VIEW) @ frame
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    size = len(image)
    return at(image, (half[:, 0] + 1) / 2 * size - 0.5, (1 - half[:, 1]) / 2 * size - 0.5), expected


def test_a_mirror_ball_shows_the_sky_upright(tmp_path, view):
    file = written(tmp_path, view, "mirror-ball-exr")["ball.exr"]
    image = programs.pixels(file)
    seen(*on_the_ball(image, view.frame), tolerance=1e-6)
    inside = view.coverage > 0.5
    np.testing.assert_array_equal(image[inside], view.image[inside])
    np.testing.assert_array_equal(by_three(file), image)
    assert (image.max(axis=-1) > 0.04).all()  # no dark texel beside the rim


@pytest.mark.parametrize(("name", "ending"), [("mirror-ball-png", "ball.png"), ("matcap-png", "matcap.png")])
def test_a_picture_is_srgb(tmp_path, view, name, ending):
    file = written(tmp_path, view, name, exposure=0.0)[ending]
    image = programs.pixels(file)
    read, expected = on_the_ball(image, view.frame)
    linear = np.where(read <= 0.04045, read / 12.92, ((read + 0.055) / 1.055) ** 2.4)
    seen(linear, expected, tolerance=0.005)
    assert b"Reflection of one view only" in file.read_bytes()
    corner = image[0, 0, 3]
    assert corner == (0 if name == "mirror-ball-png" else 1)


def test_a_matcap_has_two_passes_that_add_up(tmp_path, view):
    file = written(tmp_path, view, "matcap-exr")["matcap.exr"]
    header = programs.exrheader(file)
    names = [f"{name}.{colour}" for name in ("diffuse", "specular") for colour in "BGR"]
    assert re.findall(r"^    (\S+), 32-bit", header, re.M) == names
    image = programs.pixels(file)
    seen(*on_the_ball(image[..., :3] + image[..., 3:], view.frame), tolerance=1e-6)
    np.testing.assert_allclose(3 * image[..., :3], image[..., 3:], rtol=1e-5)


# ---- Cubes -----------------------------------------------------------------------------------------------------------


def in_a_face(image, x, y):
    return at(image, np.array([(x + 1) / 2 * len(image) - 0.5]), np.array([(1 - y) / 2 * len(image) - 0.5]))[0]


def test_six_faces(tmp_path, view):
    files = written(tmp_path, view, "cube-exr", size=SIZE)
    for k, face in enumerate(FACES):
        image = programs.pixels(files[f"{face}.exr"])
        assert image.shape == (SIZE, SIZE, 3)
        seen(in_a_face(image, *MARK), MARKS[k])
        for place in NO_MARKS:
            seen(in_a_face(image, *place), six_colours.COLOURS[k])
    np.testing.assert_array_equal(by_three(files["ny.exr"]), programs.pixels(files["ny.exr"]))
    assert f"Face {face}" in programs.exrheader(files[f"{face}.exr"])


def ktx2(file):
    """Header by ktx-parse, and the levels as arrays (6, N, N, 4)."""
    read = programs.node("ktx2.mjs", file)
    levels = []
    for k, level in enumerate(read["levels"]):
        side = max(read["pixelWidth"] >> k, 1)
        levels.append(np.frombuffer(bytes.fromhex(level), "<f2").reshape(6, side, side, 4))
    return read, levels


def test_a_ktx2_cube_by_ktx_parse(tmp_path, view):
    read, levels = ktx2(written(tmp_path, view, "ktx2", size=SIZE)["ktx2"])
    assert read["vkFormat"] == 97  # VK_FORMAT_R16G16B16A16_SFLOAT
    assert (read["pixelWidth"], read["pixelHeight"], read["pixelDepth"]) == (SIZE, SIZE, 0)
    assert (read["faceCount"], read["layerCount"], len(levels), read["typeSize"]) == (6, 0, 7, 2)
    assert read["supercompressionScheme"] == 0
    assert read["keyValue"]["KTXorientation"] == "rd"
    assert "Reflection of one view only" in read["keyValue"]["rsibr"]
    (descriptor,) = read["dataFormatDescriptor"]
    assert (descriptor["colorModel"], descriptor["colorPrimaries"], descriptor["transferFunction"]) == (1, 1, 1)
    assert descriptor["bytesPlane"][0] == 8
    found = [(one["channelType"], one["bitOffset"], one["bitLength"]) for one in descriptor["samples"]]
    assert found == [(192, 0, 15), (193, 16, 15), (194, 32, 15), (207, 48, 15)]
    for k, image in enumerate(levels[0].astype(np.float32)):
        seen(in_a_face(image, *MARK), MARKS[k])
        for place in NO_MARKS:
            seen(in_a_face(image, *place), six_colours.COLOURS[k])


def test_levels_are_means_over_solid_angle(tmp_path, view):
    """A texel of a level against the weighted mean of the four below it, with the solid angles of Lambert's formula."""
    _, levels = ktx2(written(tmp_path, view, "ktx2", size=SIZE)["ktx2"])
    edges = np.linspace(-1, 1, SIZE + 1)
    corner = np.arctan2(np.outer(edges, edges), np.sqrt(1 + edges[:, None] ** 2 + edges**2))
    angle = corner[1:, 1:] - corner[:-1, 1:] - corner[1:, :-1] + corner[:-1, :-1]
    half = SIZE // 2
    four = (levels[0][..., :3].astype(float) * angle[None, :, :, None]).reshape(6, half, 2, half, 2, 3).sum(axis=(2, 4))
    mean = four / angle.reshape(half, 2, half, 2).sum(axis=(1, 3))[None, :, :, None]
    error = np.abs(levels[1][..., :3] - mean)
    assert np.median(error) < 1e-3
    assert error.mean() < 0.01  # at edges of colours samples differ
    whole = (levels[0][..., :3].astype(float) * angle[None, :, :, None]).sum(axis=(1, 2)) / angle.sum()
    np.testing.assert_allclose(levels[-1][:, 0, 0, :3], whole, atol=0.01)
    assert (levels[0][..., 3] == 1).all()


@pytest.mark.slow
def test_a_gpu_looks_cubes_up_by_world_directions(browser, tmp_path, view):
    """Babylon.js reads the DDS, ktx-parse the KTX2, and WebGL's own samplerCube looks up."""
    written(tmp_path, view, "dds", size=SIZE)
    written(tmp_path, view, "ktx2", size=SIZE)
    d, expected = places()
    with programs.page(browser, tmp_path) as page:
        page.wait_for_function("!!window.readers", timeout=60_000)
        for kind in ("dds", "ktx2"):
            for level in (0, 1):
                call = "([kind, name, directions, level]) => window.readers[kind](name, directions, level)"
                read = page.evaluate(call, [kind, f"six.{kind}", d.tolist(), level])
                seen(np.array(read["values"])[:, :3], expected, tolerance=0.03)
                np.testing.assert_array_equal(np.array(read["values"])[:, 3], 1)
        smallest = page.evaluate(call, [kind, "six.ktx2", d.tolist(), 6])
        other = page.evaluate(call, ["dds", "six.dds", d.tolist(), 6])
        assert other["size"] == SIZE
        np.testing.assert_array_equal(smallest["values"], other["values"])
        assert np.ptp(np.array(smallest["values"])[:, :3], axis=0).max() > 0.1  # faces differ: level 6 was there


@pytest.mark.slow
@pytest.mark.parametrize(("call", "name", "gamma"), [("ballOfBabylon", "dds", 2.2), ("ballOfThree", "latlong-hdr", 1)])
def test_a_mirror_in_another_program_shows_the_map(browser, tmp_path, view, call, name, gamma):
    """A ball rendered as the documentation says, seen from v, is the sphere map; Babylon.js shows it with a gamma."""
    (file,) = (file for ending, file in written(tmp_path, view, name).items() if not ending.endswith("txt"))
    with programs.page(browser, tmp_path) as page:
        page.wait_for_function("!!window.readers", timeout=60_000)
        read = page.evaluate(f"([name, v]) => window.readers.{call}(name, v)", [file.name, VIEW.tolist()])
    image = np.array(read).reshape(96, 96, 4)[::-1]
    assert image[48, 48, 3] == 1
    d, _ = places()
    well_inside = d @ VIEW > -0.7
    assert well_inside.sum() > 40
    read, expected = on_the_ball(image, view.frame)
    seen(read[well_inside] ** gamma, expected[well_inside], tolerance=0.04)


def test_a_dds_header_is_microsofts(tmp_path, view):
    """Sizes and fields by their offsets in DDS_HEADER and DDS_HEADER_DXT10; the pixels are Babylon.js's to read."""
    files = written(tmp_path, view, "dds", size=SIZE)
    data = files["dds"].read_bytes()
    words = np.frombuffer(data[:148], "<u4")
    assert data[:4] == b"DDS "
    assert (words[1], words[3], words[4], words[7]) == (124, SIZE, SIZE, 7)
    assert data[84:88] == b"DX10"
    assert words[28] & 0xFE00 == 0xFE00  # all faces
    assert tuple(words[32:36]) == (10, 3, 4, 1)  # R16G16B16A16_FLOAT, 2D, cube, one
    assert len(data) == 148 + 6 * 8 * sum((SIZE >> k) ** 2 for k in range(7))
    assert "Reflection of one view only" in files["dds.txt"].read_text()


# ---- Light -----------------------------------------------------------------------------------------------------------


def light(values, delta=None):
    """A light of `values(directions)` at octahedral texels."""
    from rsibr.geometry.projections.octahedral import texel_directions

    size = 256
    d = np.array(texel_directions(size), dtype=float).T
    picture = values(d).reshape(size, size, 3).astype(np.float32)
    made = Light(picture) if delta is None else Light(picture, delta=delta)
    return PublishedLight("sky", "a formula", made)


def test_harmonics_by_three_js(tmp_path):
    """Radiance of two bands, whose irradiance is known: π a + 2π/3 b·n + c (π/3 + π/4 (n_z² − 1/3))."""
    a, b, c = np.array([1.0, 0.5, 2.0]), np.array([[0.3, -0.2, 0.4], [0.1, 0.5, -0.3], [0.7, 0.2, -0.6]]), 0.8

    def values(d):
        return a + d @ b.T + c * d[:, 2:] ** 2

    d, _ = places()
    found = json.loads(written(tmp_path, light(values), "sh")["sh.json"].read_text())
    asked = tmp_path / "asked.json"
    asked.write_text(json.dumps({"coefficients": found["radiance"], "directions": d.tolist()}))
    read = np.array(programs.node("harmonics.mjs", asked))
    np.testing.assert_allclose(read[:, 0], values(d), atol=1e-3)
    irradiance = np.pi * a + 2 * np.pi / 3 * d @ b.T + c * (np.pi / 3 + np.pi / 4 * (d[:, 2:] ** 2 - 1 / 3))
    np.testing.assert_allclose(read[:, 1], irradiance, atol=4e-3)
    # What the file calls irradiance, with the functions that it prints
    printed = ("0.282095", "0.488603 y", "0.488603 z", "0.488603 x", "1.092548 x y", "1.092548 y z")
    assert found["functions"] == [*printed, "0.315392 (3 z^2 - 1)", "1.092548 x z", "0.546274 (x^2 - y^2)"]
    x, y, z = d.T
    first, second = 0.488603 * np.stack([y, z, x]), 1.092548 * np.stack([x * y, y * z])
    last = np.stack([0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y)])
    basis = np.concatenate([np.full((1, len(d)), 0.282095), first, second, last]).T
    np.testing.assert_allclose(basis @ np.array(found["irradiance"]), irradiance, atol=4e-3)
    text = np.loadtxt((tmp_path / "sky.sh.txt").open())
    np.testing.assert_allclose(text, found["radiance"], rtol=1e-8)


def test_lights_without_extent_are_in_the_harmonics_and_not_in_the_levels(tmp_path):
    delta = DeltaLights(np.array([[0, 1, 0]], np.float32), np.array([[3, 2, 1]], np.float32))
    black = light(np.zeros_like, delta)
    found = json.loads(written(tmp_path, black, "sh")["sh.json"].read_text())
    np.testing.assert_allclose(found["radiance"][1], 0.488603 * np.array([3, 2, 1]), rtol=1e-5)
    made = format_of("roughness-levels", {"size": 32}).encode(black)
    assert made.notes == ("1 lights without extent are not in it",)


def test_levels_by_roughness_say_how_rough_each_is(tmp_path):
    """Levels of a lamp against the kernel summed straight over the light, at the roughness that the file states."""
    lamp = np.array([0.48, 0.64, -0.6])

    def values(d):
        return np.stack([np.ones(len(d)), 0.2 + 30 * (d @ lamp > 0.95), 0.5 + 0.5 * d[:, 0]], axis=1)

    sky = light(values)
    files = written(tmp_path, sky, "roughness-levels", size=64)
    read, levels = ktx2(files["light.ktx2"])
    told = json.loads(files["light.json"].read_text())
    assert [one["size"] for one in told["levels"]] == [len(level[0]) for level in levels] == [64, 32, 16]
    assert told["levels"][0]["alpha"] == 0
    assert "not a reflection" in read["keyValue"]["rsibr"]
    from rsibr.geometry.projections.octahedral import texel_directions, texel_solid_angles

    d = np.array(texel_directions(256), float).T
    radiance, angle = sky.light.picture.reshape(-1, 3), texel_solid_angles(256)
    for one, level in list(zip(told["levels"], levels, strict=True))[1:]:
        side, alpha = one["size"], one["alpha"]
        assert one["perceptual_roughness"] == pytest.approx(np.sqrt(alpha))
        for k, place in ((3, (0.3, 0.7)), (2, (0.44, 0.56)), (5, (-0.8, 0.9))):
            row, column = int((1 - place[1]) / 2 * side), int((place[0] + 1) / 2 * side)
            x, y = (column + 0.5) * 2 / side - 1, 1 - (row + 0.5) * 2 / side
            r = np.array(list(FACES.values())[k](np.array(x), np.array(y)), float)
            cosine = d @ (r / np.linalg.norm(r))
            s = (1 - cosine) / 2
            kernel = np.maximum(cosine, 0) / (alpha**2 + (1 - alpha**2) * s) ** 2 * angle
            expected = kernel @ radiance / kernel.sum()
            np.testing.assert_allclose(level[k, row, column, :3], expected, rtol=0.02)


# ---- USD -------------------------------------------------------------------------------------------------------------


def test_a_dome_light_by_three_js_and_by_pixar(tmp_path, view):
    files = written(tmp_path, view, "usda", size=128)
    stage = programs.node("usda.mjs", files["usda"])
    dome = stage['def DomeLight "Dome"']
    assert dome["token inputs:texture:format"].strip('"') == "latlong"
    assert dome["asset inputs:texture:file"].strip("@") == "./six.dome.exr"
    seen(*in_openexr(programs.pixels(files["dome.exr"])))  # UsdLux: latlong "adheres to the OpenEXR specification"
    pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdGeom, UsdLux

    assert pxr
    opened = Usd.Stage.Open(str(files["usda"]))
    light = UsdLux.DomeLight(opened.GetDefaultPrim())
    assert light
    assert light.GetTextureFormatAttr().Get() == UsdLux.Tokens.latlong
    assert light.GetTextureFileAttr().Get().resolvedPath == str(files["dome.exr"])
    assert UsdGeom.GetStageUpAxis(opened) == UsdGeom.Tokens.y
    assert "Reflection of one view only" in opened.GetMetadata("documentation")


# ---- Views -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["latlong-exr", "mirror-ball-exr", "matcap-exr", "cube-exr", "usda"])
def test_one_of_several_views_bears_its_name(tmp_path, name):
    several = six_colours.view(16, name="view_0003")
    for ending, file in written(tmp_path, several, name).items():
        if ending.endswith("exr"):
            assert 'view (type string): "view_0003"' in programs.exrheader(file)
