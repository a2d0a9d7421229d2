"""The manifest: kept to the byte, refused when altered, and able to say in what two bakes differ."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from rsibr.errors import BakeError
from rsibr.store.difference import differences
from rsibr.store.manifest import EnvironmentRecord, Manifest, MaterialRecord, read_manifest, write_manifest

OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
FACES = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]


def planned(samples: int = 64, **changes: Any) -> Manifest:
    config = {"map": {"resolution": 8}, "sampling": {"samples": samples, "seed": 3}, "material": {"preset": "größer"}}
    fields: dict[str, Any] = {
        "config": config,
        "identity": {"config": config, "environment": {"content": "ab" * 32}, "variant": "llvm_ad_rgb"},
        "packages": {"numpy": "2.0", "mitsuba": "3.9.1"},
        "variant": "llvm_ad_rgb",
        "environment": EnvironmentRecord(name="city", clipped=3, lowest=-1e-3),
        "material": MaterialRecord(name="paint", warp="mirror"),
        "resolution": 8,
        "directions": OCTAHEDRON,
        "triangles": FACES,
    }
    return Manifest.planned(**{**fields, **changes})


def one_done() -> Manifest:
    manifest = planned()
    return manifest.with_views(manifest.views[2].finished("cd" * 32, 0.1 + 0.2, 4096))


def forge(file: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change the manifest and give it the right checksum: by the standard library alone, as the format documents it."""
    body = json.loads(file.read_text("utf-8"))
    del body["checksum"]
    change(body)
    text = json.dumps(body, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    body["checksum"] = hashlib.sha256(text.encode()).hexdigest()
    file.write_text(json.dumps(body, indent=1, ensure_ascii=False) + "\n", "utf-8")


def test_round_trip(tmp_path):
    file = tmp_path / "manifest.json"
    write_manifest(file, one_done())
    found = read_manifest(file)
    assert found == one_done()
    assert found.pending == [0, 1, 3, 4, 5]
    assert found.seconds == 0.1 + 0.2
    assert found.size == 4096
    assert found.views[2].file == "maps/view_0002.exr"
    write_manifest(tmp_path / "again.json", found)
    assert (tmp_path / "again.json").read_bytes() == file.read_bytes()


def test_what_it_keeps_can_be_read_without_us(tmp_path):
    write_manifest(tmp_path / "manifest.json", one_done())
    body = json.loads((tmp_path / "manifest.json").read_text("utf-8"))
    assert body["schema_version"] == 1
    assert body["config"]["sampling"] == {"samples": 64, "seed": 3}
    text = json.dumps(body["config"], sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    assert body["config_hash"] == hashlib.sha256(text.encode()).hexdigest()
    assert next(iter(body)) == "schema_version"
    assert list(body)[-1] == "checksum"
    assert body["directions"] == OCTAHEDRON.tolist()


def test_every_flipped_bit_is_found(tmp_path):
    file = tmp_path / "manifest.json"
    write_manifest(file, one_done())
    data = file.read_bytes()
    random = np.random.default_rng(5)
    for offset in range(0, len(data), 2):
        flipped = bytearray(data)
        flipped[offset] ^= 1 << int(random.integers(8))
        file.write_bytes(flipped)
        with pytest.raises(BakeError, match=r"manifest\.json"):
            read_manifest(file)


def test_every_truncation_is_found(tmp_path):
    file = tmp_path / "manifest.json"
    write_manifest(file, one_done())
    data = file.read_bytes()
    for length in range(0, len(data), 11):
        file.write_bytes(data[:length])
        with pytest.raises(BakeError, match=r"manifest\.json"):
            read_manifest(file)


@pytest.mark.parametrize("text", ["[]", "null", '"a"', "{}", "[" * 100_000, '{"checksum": 1, "schema_version": NaN}'])
def test_foreign_json_is_refused(tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(BakeError, match="no manifest of a bake"):
        read_manifest(tmp_path / "manifest.json")


def test_an_unknown_schema_is_named(tmp_path):
    file = tmp_path / "manifest.json"
    write_manifest(file, planned())
    forge(file, lambda body: body.update(schema_version=2, news="from the future"))
    with pytest.raises(BakeError, match=r"schema version 2; this rsibr reads version 1.*--fresh"):
        read_manifest(file)


@pytest.mark.parametrize(
    "change",
    [
        lambda body: body["views"][0].update(file="../../outside.exr"),
        lambda body: body["views"][0].update(done=True),
        lambda body: body["views"][2].update(done=False),
        lambda body: body["views"][2].update(sha256="short"),
        lambda body: body["views"].pop(),
        lambda body: body["views"].reverse(),
        lambda body: body["triangles"][0].__setitem__(0, 6),
        lambda body: body["config"]["sampling"].update(samples=65),
        lambda body: body.update(surprise=1),
        lambda body: body.pop("variant"),
    ],
)
def test_a_forged_manifest_is_refused(tmp_path, change):
    file = tmp_path / "manifest.json"
    write_manifest(file, one_done())
    forge(file, lambda _: None)
    assert read_manifest(file) == one_done()  # the forger knows the format: what follows is not found by the checksum
    forge(file, change)
    with pytest.raises(BakeError, match="no valid manifest"):
        read_manifest(file)


def test_what_json_cannot_hold_is_refused():
    with pytest.raises(ValueError, match="JSON"):
        planned(config={"scale": float("nan")})
    with pytest.raises(TypeError, match="serializable"):
        planned(identity={"file": Path("a.exr")})
    with pytest.raises(ValidationError, match="triangle"):
        planned(triangles=[[0, 1, -1]])
    with pytest.raises(ValidationError, match="finite"):
        planned(directions=[[0.0, 0.0, np.inf]])


def test_equal_bakes_do_not_differ():
    assert differences(one_done(), planned(packages={"numpy": "2.1"})) == []


def test_differences_are_told_key_by_key():
    assert differences(planned(64), planned(128)) == ["sampling.samples: 64 → 128"]
    bigger = planned(identity={"config": {"map": {"resolution": 16}}, "variant": "cuda_ad_rgb"}, resolution=16)
    assert differences(planned(), bigger) == [
        "map.resolution: 8 → 16",
        "material.preset: größer → absent",
        "sampling.samples: 64 → absent",
        "sampling.seed: 3 → absent",
        "environment.content: abababababab → absent",
        "variant: llvm_ad_rgb → cuda_ad_rgb",
    ]


def test_other_views_are_a_difference_though_the_config_is_the_same():
    told = differences(planned(), planned(directions=OCTAHEDRON[::-1]))
    assert len(told) == 1
    assert told[0].startswith("directions and triangles: ")
    assert "number of views: 6 → 5" in differences(planned(), planned(directions=OCTAHEDRON[:5], triangles=FACES[:1]))


def test_a_long_list_of_differences_is_cut_short():
    many, none = ({f"key{i}": value for i in range(30)} for value in (1, 2))
    told = differences(planned(identity=many), planned(identity=none))
    assert len(told) == 9
    assert told[-1] == "and 22 more"
    long = differences(planned(identity={"file": "a" * 500}), planned(identity={"file": "b" * 500}))
    assert len(long[0]) < 150
