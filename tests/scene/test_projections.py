"""Environments that are no latitude–longitude maps: six faces, and one picture in any projection."""

from __future__ import annotations

from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR
import pytest

from rsibr.baking.baker import bake
from rsibr.errors import InputError
from rsibr.geometry.projections.projection import projection, projection_names
from rsibr.geometry.projections.sheet_layout import layouts
from rsibr.geometry.projections.sphere_image import SphereImage, texel_directions, texel_solid_angles
from rsibr.scene.config import EnvironmentConfig, load_config, parse_config
from rsibr.scene.environment import environment_digest, load_environment
from rsibr.scene.overrides import apply_overrides
from rsibr.scene.panorama.resampled import to_latlong
from tests.arrays import to_numpy, vector
from tests.scene.cube_faces import light, write_faces
from tests.scene.maps import latlong_directions, write_channels, write_exr

WHOLE = [name for name in projection_names() if name != "sphere-map"]


def radiance(environment, directions):
    """Radiance (N, 3) that Mitsuba's emitter sends from the directions (N, 3)."""
    (emitter,) = mi.load_dict({"type": "scene", "emitter": environment.emitter()}).emitters()
    si = dr.zeros(mi.SurfaceInteraction3f, len(directions))
    si.wi = -mi.Vector3f(np.asarray(directions, dtype=np.float32).T)
    return np.array(emitter.eval(si)).T


def sphere(count=1000):
    directions = np.random.default_rng(3).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def refusal(**keys):
    with pytest.raises(InputError) as caught:
        load_environment(EnvironmentConfig(**keys))
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture
def faces(tmp_path):
    return write_faces(tmp_path)


def test_six_faces_light_the_scene_from_where_they_lie(faces):
    environment = load_environment(EnvironmentConfig(faces=faces))
    assert environment.image.shape == (129, 256, 3)
    assert environment.name == "sky"
    assert environment.notes == ("its six faces were converted to 256 × 129 texels of latitude and longitude",)
    d = sphere()
    assert np.abs(radiance(environment, d) - light(d)).max() < 0.006 * light(d).max()


def test_faces_are_turned_and_scaled_like_a_map(faces):
    environment = load_environment(EnvironmentConfig(faces=faces, rotation_deg=90.0, scale=2.0))
    d = sphere()
    unturned = d @ np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # +Z turns to +X
    assert np.abs(radiance(environment, d) - 2 * light(unturned)).max() < 0.012 * light(d).max()


@pytest.mark.parametrize("name", WHOLE)
def test_a_picture_in_any_projection_lights_the_scene_from_where_it_lies(tmp_path, name):
    """Mean error of the smooth radiance below 1 %, in every layout that the projection has; more at the rims."""
    of = projection(name)
    columns, rows = of.axes(32 if of.sheets == 6 else 64)
    values = light(to_numpy(texel_directions(of, rows.count)).T)
    for layout in layouts(of):
        picture = layout.joined(values.reshape(of.sheets, rows.count, columns.count, 3))
        environment = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "a.exr", picture), projection=name))
        d = sphere()
        bound = 0.015 if name == "orthographic-pair" else 0.01
        assert np.abs(radiance(environment, d) - light(d)).mean() < bound * light(d).mean()


@pytest.mark.parametrize(("row", "column", "peak"), [(16, 15, 0.7), (0, 0, 0.35), (3, 17, 0.5)])
def test_a_lone_bright_texel_of_a_face_keeps_its_energy(row, column, peak):
    """Within 3 %, wherever it lies; and a share of its radiance at its centre, the least in the corners of a face."""
    cube, latlong, face = projection("cube"), projection("latlong"), 3
    values = np.zeros((6, 32, 32, 3), np.float32)
    values[face, row, column] = 1.0
    image = to_latlong(values, cube, 2**20, "")
    held = (texel_solid_angles(latlong, image.shape[:2])[0] * image[..., 0]).sum()
    assert held == pytest.approx(texel_solid_angles(cube, 32)[face, row, column], rel=0.03)
    centre = to_numpy(texel_directions(cube, 32)).T[(face * 32 + row) * 32 + column]
    assert to_numpy(SphereImage(latlong, image[None]).lookup(vector([centre])))[0, 0] > peak


@pytest.mark.parametrize("name", ["latlong-filament", "latlong-debevec", "latlong-three", "polar"])
def test_texels_of_another_convention_stay_as_they_are(tmp_path, name):
    """Every texel of the file, in its direction."""
    of, noise = projection(name), np.random.default_rng(4).random((16, 32, 3)).astype(np.float32)
    environment = load_environment(EnvironmentConfig(file=write_exr(tmp_path / "a.exr", noise), projection=name))
    assert environment.image.shape == (33, 32, 3)
    seen = radiance(environment, to_numpy(texel_directions(of, (16, 32))).T)
    assert np.abs(seen - noise.reshape(-1, 3)).max() < 2e-4


def test_the_digest_is_that_of_the_content(tmp_path, faces):
    config = EnvironmentConfig(faces=faces)
    digest = environment_digest(config)
    moved = {name: path.rename(tmp_path / f"other-{name}.exr") for name, path in faces.items()}
    assert environment_digest(EnvironmentConfig(faces=moved)) == digest
    assert environment_digest(EnvironmentConfig(faces=moved, projection="cube-openexr")) != digest
    assert environment_digest(EnvironmentConfig(faces=moved, scale=2.0)) != digest
    assert environment_digest(EnvironmentConfig(faces=moved, rotation_deg=1.0)) != digest
    assert environment_digest(EnvironmentConfig(faces={**moved, "ny": moved["py"]})) != digest


def test_a_pattern_names_six_files_relative_to_the_config(tmp_path, faces):
    (tmp_path / "a.toml").write_text('environment.faces = "sky_{face}.exr"\nmaterial.preset = "mirror-silver"\n')
    config = load_config(tmp_path / "a.toml")
    assert config.environment.faces == faces
    assert parse_config(config.to_dict(), Path("/elsewhere")) == config
    table = {"environment": {"faces": {name: path.name for name, path in faces.items()}}}
    assert parse_config({**table, "material": {"preset": "mirror-silver"}}, tmp_path).environment == config.environment


def test_an_override_of_one_source_removes_the_others():
    config = {"environment": {"file": "sky.exr", "scale": 2.0}}
    assert apply_overrides(config, ["environment.faces=sky_{face}.exr"]) == {
        "environment": {"faces": "sky_{face}.exr", "scale": 2.0}
    }


@pytest.mark.parametrize(
    ("environment", "says"),
    [
        ({"faces": "sky.exr"}, 'environment.faces = "sky.exr" should have {face} in it'),
        ({"faces": {"px": "a"}}, "nx, py, ny, pz, nz missing"),
        ({"faces": dict.fromkeys(("px", "nx", "py", "ny", "pz", "front"), "a")}, "no face is called front"),
        ({"faces": {**dict.fromkeys(("px", "nx", "py", "ny", "pz"), "a"), "nz": 3}}, "nz should be the path of a file"),
        ({"faces": 3}, "should be a table of the paths"),
        ({"faces": "{face}", "file": "a"}, "exactly one of file, faces, emitter (given: file, faces)"),
        ({"emitter": {"type": "constant"}, "projection": "cube"}, "projection is that of a file"),
    ],
)
def test_a_config_with_mistaken_faces_is_one_line(environment, says):
    with pytest.raises(InputError) as caught:
        parse_config({"environment": environment, "material": {"preset": "mirror-silver"}}, Path("/scene"))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_faces_that_are_no_cube_are_refused(tmp_path, faces):
    other = write_exr(tmp_path / "small.exr", np.ones((16, 16, 3)))
    assert "small.exr: face py has 16 × 16 texels, face px has 32 × 32. Save" in refusal(faces={**faces, "py": other})
    oblong = write_exr(tmp_path / "oblong.exr", np.ones((32, 16, 3)))
    assert "oblong.exr: face ny has 16 × 32 texels: it is not square" in refusal(faces={**faces, "ny": oblong})
    assert "gone.exr: there is no such environment map" in refusal(faces={**faces, "nz": tmp_path / "gone.exr"})
    whole = write_channels(tmp_path / "w.exr", {"RGB": np.ones((32, 32, 3), np.float32)}, envmap=OpenEXR.ENVMAP_LATLONG)
    assert "w.exr: its envmap attribute says latlong: it is no face" in refusal(faces={**faces, "px": whole})
    assert "'polar' has no six faces" in refusal(faces=faces, projection="polar")
    assert "environment.projection: unknown projection ''" in refusal(faces=faces, projection="")
    assert "environment.projection: unknown projection 'cub'. Did you mean 'cube'" in refusal(
        faces=faces, projection="cub"
    )


def test_a_picture_that_is_not_in_its_projection_is_refused(tmp_path):
    path = write_exr(tmp_path / "a.exr", np.ones((16, 32, 3)))
    assert "a.exr: its 32 × 16 texels are no 'cube'. Save it with square sheets, 6:1 (row)" in refusal(
        file=path, projection="cube"
    )
    assert "environment.projection: unknown projection ''" in refusal(file=path, projection="")
    assert "environment.projection: unknown projection 'latlon'. Did you mean 'latlong'" in refusal(
        file=path, projection="latlon"
    )
    assert "'sphere-map' shows a hemisphere" in refusal(file=path, projection="sphere-map")
    whole = write_channels(tmp_path / "w.exr", {"RGB": np.ones((32, 32, 3), np.float32)}, envmap=OpenEXR.ENVMAP_LATLONG)
    assert "says latlong, and environment.projection 'polar'. Leave out" in refusal(file=whole, projection="polar")


def test_negative_texels_of_faces_are_set_to_zero_and_counted(tmp_path, faces):
    image = np.ones((32, 32, 3))
    image[3, 4] = -2.0
    environment = load_environment(EnvironmentConfig(faces={**faces, "py": write_exr(tmp_path / "n.exr", image)}))
    assert (environment.clipped, environment.lowest) == (3, -2.0)
    assert environment.image.min() >= 0.0


@pytest.mark.slow
def test_a_map_and_its_six_faces_bake_to_the_same(tmp_path, faces):
    """Every texel within 6 standard deviations of the noise of both and 1 % for the resampling; the mean in 0.2 %."""
    whole = write_exr(tmp_path / "whole.exr", light(latlong_directions(129, 256)))
    sources = {"file": {"file": str(whole)}, "faces": {"faces": {name: str(path) for name, path in faces.items()}}}
    settings = {"material": {"preset": "glossy-plastic"}, "map": {"resolution": 16}, "sampling": {"samples": 256}}
    one, other = (bake({"environment": sources[k], **settings}, out=tmp_path / f"{k}.rsibr") for k in sources)
    for view in range(one.view_count):
        a, b = one.map(view), other.map(view)
        inside = a.coverage == 1
        noise = np.sqrt(a.variance + b.variance)[inside]
        assert (np.abs(a.radiance - b.radiance)[inside] < 6 * noise + 0.01 * a.radiance[inside]).all()
        assert a.radiance[inside].mean() == pytest.approx(b.radiance[inside].mean(), rel=0.002)
