"""The light of a bake: whole or not there, the same after every interruption, and never taken for what it is not."""

import io
import json
import os
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from rsibr.baking import view
from rsibr.baking.baker import bake
from rsibr.errors import BakeError
from rsibr.light.delta_lights import DeltaLights
from rsibr.light.environment_pyramid import EnvironmentPyramid, level_widths
from rsibr.light.irradiance import irradiance_map
from rsibr.light.radiance import Light
from rsibr.lobes.proxy_ratio import NODES
from rsibr.scene.orientation import rotation_about_y
from rsibr.store.bake import BakeWriter, open_bake
from rsibr.store.light_file import decode_light, encode_light, is_negative
from rsibr.store.manifest import LIGHT_NAME
from tests.store.synthetic import COUNT, SECONDS, baked, content, manifest
from tests.store.test_store import damages

CONFIG = """
[environment]
file = "{environment}"
[material]
preset = "matte-lambert"
[map]
resolution = 8
[sampling]
samples = 8
"""


@pytest.fixture(autouse=True)
def _no_sync(monkeypatch):
    """No machine dies here: syncing to the disk would only take time."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


@pytest.fixture
def config(tmp_path, asymmetric_environment):
    path = tmp_path / "small.toml"
    path.write_text(CONFIG.format(environment=asymmetric_environment))
    return path


MATTE = np.array([[0.3, 0.0, 0.1], [0.7, 0.2, 0.0]])


def light(seed=3, with_image=False, with_tables=False):
    """A small picture with all that a light may hold: a sun, black, and the smallest numbers."""
    image = np.random.default_rng(seed).gamma(0.3, 2.0, (16, 16, 3)).astype(np.float32)
    image[0, 0], image[1, 1], image[2, 2] = 1e6, 0.0, 1e-30
    made = Light(image, image[:5, :8].copy(), rotation_about_y(20)[:3, :3]) if with_image else Light(image)
    return made.with_tables(glossy=True, matte=[MATTE, 2 * MATTE]) if with_tables else made


def images(light):
    """All images of a light, in their order."""
    known = [light.picture, light.image, *light.levels, *(one.image for one in light.irradiances)]
    return [image for image in known if image is not None]


def same(one, other):
    pairs = list(zip(images(one), images(other), strict=False))
    weights = [[irradiance.weights for irradiance in known.irradiances] for known in (one, other)]
    return (
        len(images(one)) == len(images(other))
        and all(np.array_equal(a, b) for a, b in pairs)
        and np.allclose(one.frame, other.frame, atol=1e-7)
        and np.allclose(*weights, atol=1e-7)
    )


def write(path, views=COUNT, **options):
    """A synthetic bake with its light, or the first views of it."""
    with BakeWriter.open(path, manifest(), **options) as writer:
        if not writer.has_light:
            writer.commit_light(light())
        for index in writer.pending[:views]:
            writer.commit(index, baked(COUNT, index), SECONDS)


# --- The file ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("with_image", [False, True])
@pytest.mark.parametrize("with_tables", [False, True])
def test_it_comes_back_to_the_last_bit(with_image, with_tables):
    whole = light(3, with_image, with_tables)
    found = decode_light(encode_light(whole), "x")
    assert same(found, whole)
    assert len(found.levels) == (len(level_widths(16)) - 1 if with_tables else 0)


def test_lights_without_extent_come_back_and_damaged_ones_are_refused():
    delta = DeltaLights(
        np.array([[0, 0.6, 0.8], [1, 0, 0]], np.float32), np.array([[3, 2, 1], [0, 1e6, 1e-3]], np.float32)
    )
    table = np.random.default_rng(1).random((NODES, NODES, 3), dtype=np.float32)
    found = decode_light(encode_light(replace(light(), delta=delta, proxy_ratios={"glossy-0.1": table})), "x")
    assert np.array_equal(found.delta.directions, delta.directions)
    assert np.array_equal(found.delta.irradiance, delta.irradiance)
    assert {name: value.tolist() for name, value in found.proxy_ratios.items()} == {"glossy-0.1": table.tolist()}
    assert len(decode_light(encode_light(light()), "x").delta) == 0
    for broken in (
        replace(delta, directions=2 * delta.directions),
        replace(delta, irradiance=np.inf + delta.irradiance),
    ):
        with pytest.raises(BakeError, match="is no light of rsibr"):
            decode_light(encode_light(replace(light(), delta=broken)), "x")
    with pytest.raises(BakeError, match="is no light of rsibr"):
        decode_light(encode_light(replace(light(), proxy_ratios={"glossy-0.1": table[1:]})), "x")


def test_directions_of_lights_without_extent_may_be_negative_and_their_power_not():
    down = np.float32([[0, -0.6, -0.8]])
    assert not is_negative(replace(light(), delta=DeltaLights(down, np.float32([[1, 2, 0]]))))
    assert is_negative(replace(light(), delta=DeltaLights(down, np.float32([[1, -2, 0]]))))
    assert is_negative(Light(-light().picture))


def test_what_the_file_holds_is_what_would_be_computed():
    """Levels and irradiance from the file put the same texels on the device as the picture alone would."""
    found = decode_light(encode_light(light(with_tables=True)), "x")
    stored, computed = EnvironmentPyramid.of(found.picture, found.levels), EnvironmentPyramid.of(found.picture)
    assert np.array_equal(stored.texels.numpy().view(np.uint32), computed.texels.numpy().view(np.uint32))
    assert found.irradiance(MATTE) is found.irradiances[0].image
    assert found.irradiance(2 * MATTE) is found.irradiances[1].image
    other = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    assert np.array_equal(found.irradiance(other), irradiance_map(found.picture, other))


def test_each_level_says_how_wide_it_is():
    """One texel, 2√π/R rad, and √2 more a level, as file-format.md promises to other readers of the file."""
    with OpenEXR.File(io.BytesIO(encode_light(light(with_tables=True)))) as file:
        widths = {part.name(): part.header["rsibr:width"] for part in file.parts if part.name().startswith("level.")}
    assert list(widths) == [f"level.{number:02d}" for number in range(1, len(widths) + 1)]
    assert list(widths.values()) == pytest.approx(2 * np.sqrt(np.pi) / 16 * np.sqrt(2.0) ** np.arange(len(widths)))


def test_levels_of_another_picture_are_refused():
    whole = light(with_tables=True)
    for wrong in (replace(whole, levels=whole.levels[:-1]), replace(whole, levels=whole.levels[::-1])):
        with pytest.raises(BakeError, match="is no light of rsibr"):
            decode_light(encode_light(wrong), "a.exr")


def test_equal_lights_give_equal_bytes_and_others_others():
    assert encode_light(light()) == encode_light(light())
    assert encode_light(light()) != encode_light(light(4))
    assert encode_light(light()) != encode_light(light(3, with_image=True))


def test_what_is_no_light_is_refused(capfd):
    data = encode_light(light())
    oblong = encode_light(Light(light().picture[:8]))
    for bad in (b"", b"not an image", data[:100], data[: len(data) // 2], data[:-1], oblong):
        with pytest.raises(BakeError, match=r"a\.exr: is no light of rsibr, or is truncated or altered"):
            decode_light(bad, "a.exr")
    assert capfd.readouterr().out == ""


# --- In a bake --------------------------------------------------------------------------------------------------------


def test_a_bake_keeps_its_light_and_counts_it(tmp_path):
    write(tmp_path)
    opened = open_bake(tmp_path)
    assert same(opened.light, light())
    assert opened.manifest.light.bytes == (tmp_path / LIGHT_NAME).stat().st_size
    assert opened.bytes == sum(state.bytes for state in opened.manifest.views) + opened.manifest.light.bytes


def test_every_damage_to_the_light_is_found_on_opening_and_on_reading_and_mended_by_baking(tmp_path, capfd):
    write(tmp_path)
    whole, opened = content(tmp_path), open_bake(tmp_path)
    for damaged in damages(whole[LIGHT_NAME]):
        (tmp_path / LIGHT_NAME).write_bytes(damaged)
        with pytest.raises(BakeError, match=r"light\.exr: is truncated or altered"):
            open_bake(tmp_path)
        with pytest.raises(BakeError, match=r"light\.exr: is truncated or altered"):
            _ = opened.light
    assert capfd.readouterr() == ("", "")  # found before OpenEXR sees it
    write(tmp_path)
    assert content(tmp_path) == whole


def test_a_missing_light_is_found_on_opening_and_made_again(tmp_path):
    write(tmp_path)
    whole = content(tmp_path)
    (tmp_path / LIGHT_NAME).unlink()
    with pytest.raises(BakeError, match=r"light\.exr: is missing.*[Rr]un the same `rsibr bake` command again"):
        open_bake(tmp_path)
    write(tmp_path)
    assert content(tmp_path) == whole


def test_a_bake_older_than_lights_opens_and_says_so_when_asked_for_one(tmp_path):
    with BakeWriter.open(tmp_path, manifest()) as writer:
        for index in writer.pending:
            writer.commit(index, baked(COUNT, index), SECONDS)
    text = json.loads((tmp_path / "manifest.json").read_text())
    assert text["light"] is None
    opened = open_bake(tmp_path)
    assert opened.view_count == COUNT
    with pytest.raises(BakeError, match=r"light\.exr: is missing: the bake was made before lights were kept"):
        _ = opened.light


def test_interrupted_while_it_is_written_it_is_not_there(tmp_path, monkeypatch):
    """Killed before its change of name, between that and the manifest, and between the manifest and the first view."""
    write(tmp_path / "whole")
    whole = content(tmp_path / "whole")
    real = os.replace
    for kept in (1, 2, 3):  # changes of name before the end: the manifest's, the light's, the manifest's
        path, left = tmp_path / str(kept), iter(range(kept))

        def stopping(source, target, left=left):
            if next(left, None) is None:
                raise KeyboardInterrupt
            real(source, target)

        monkeypatch.setattr(os, "replace", stopping)
        with pytest.raises(KeyboardInterrupt):
            write(path)
        monkeypatch.setattr(os, "replace", real)
        assert (path / LIGHT_NAME).exists() == (kept >= 2)
        with BakeWriter.open(path, manifest()) as writer:
            assert writer.has_light == (kept == 3)
        write(path)
        assert content(path) == whole


def test_a_bake_that_goes_on_makes_no_second_light(config, tmp_path, monkeypatch):
    """And ends with the bytes of one that was never interrupted: stopped between the light and the first view."""
    whole = content(bake(config, out=tmp_path / "whole.rsibr").path)

    def dying(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as killed:
        killed.setattr(view, "bake_view", dying)
        with pytest.raises(KeyboardInterrupt):
            bake(config, out=tmp_path / "b.rsibr")
    with pytest.raises(BakeError, match=r"0 of \d+ views"):
        open_bake(tmp_path / "b.rsibr")
    monkeypatch.setattr("rsibr.baking.parts.light_of", dying)
    resumed = content(bake(config, out=tmp_path / "b.rsibr").path)
    assert {k: v for k, v in resumed.items() if k != "manifest.json"} == {
        k: v for k, v in whole.items() if k != "manifest.json"
    }
    light_of = [json.loads(files["manifest.json"])["light"] for files in (resumed, whole)]
    assert light_of[0] == light_of[1]


def test_a_fresh_bake_under_another_light_keeps_nothing_of_the_old(config, tmp_path, gradient_sky):
    first = bake(config, out=tmp_path / "b.rsibr").light
    second = bake(config, out=tmp_path / "b.rsibr", overrides=[f"environment.file={gradient_sky}"], fresh=True)
    assert not np.array_equal(second.light, first)
    assert same(open_bake(second.path).light, second.light)


@pytest.mark.parametrize("radiance", [0.0, 2.0])
def test_an_even_or_black_environment_has_its_light(tmp_path, radiance):
    """Such an emitter answers for all directions at once."""
    config = tmp_path / "even.toml"
    emitter = f'emitter = {{type = "constant", radiance = {radiance}}}'
    config.write_text(CONFIG.replace('file = "{environment}"', emitter))
    made = bake(config, out=tmp_path / "even.rsibr")
    assert made.light.picture.shape == (512, 512, 3)
    assert np.array_equal(np.unique(made.light.picture), [radiance])
