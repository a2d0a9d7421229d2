"""Jobs of a batch file: their names, settings and order, and one clear line for every mistake."""

from __future__ import annotations

import pickle
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rsibr.batches.config import parse_batch
from rsibr.batches.job import Job, settings_digest
from rsibr.batches.matrix import Matrix, shard_bounds
from rsibr.batches.names import NameRegister, fault_of
from rsibr.errors import InputError
from rsibr.scene.config import CHECKED_TOGETHER, Config, parse_config
from tests.batches.files import BASE, batch, names

WHOLE: dict[str, Any] = {
    "name": "{material}/{environment}-{map.resolution}",
    "matrix": {
        "material": ["solid-red", {"file": "materials/*.xml"}],
        "environment": ["skies/*.exr"],
        "map.resolution": [16, 32],
    },
    "exclude": [{"material": "chalk", "map.resolution": 32}],
    "include": [{"material": "pearl-white", "environment": "skies/noon.exr", "sampling.samples": 64}],
}


def test_jobs_are_all_combinations_without_the_excluded_and_with_the_included(folder):
    expected = [
        f"{material}/{sky}-{side}"
        for material, sky, side in product(("solid-red", "chalk", "slate"), ("dawn", "noon"), (16, 32))
        if (material, side) != ("chalk", 32)
    ]
    assert names(folder, **WHOLE) == [*expected, "pearl-white/noon-8"]


def test_a_job_is_the_config_that_one_would_write_by_hand(folder):
    matrix = Matrix.of(batch(folder, then={"validate": {"views": 4}, "publish": ["latlong"]}, **WHOLE))
    matrix.check()
    jobs = {job.name: job for job in matrix.jobs()}
    by_hand = {
        **BASE,
        "environment": {"file": "skies/noon.exr"},
        "material": {"file": "materials/slate.xml"},
        "map": {"resolution": 32},
    }
    job = jobs["slate/noon-32"]
    assert job.settings == parse_config(by_hand, folder).to_dict()
    assert job.values == {"material": "slate", "environment": "noon", "map.resolution": 32}
    assert (job.then.validate, job.then.publish) == ({"views": 4}, ("latlong",))
    added = jobs["pearl-white/noon-8"]
    assert added.settings["sampling"]["samples"] == 64
    assert added.settings["map"] == {"resolution": 8}


def test_a_job_is_plain_data(folder):
    matrix = Matrix.of(batch(folder, **WHOLE))
    matrix.check()
    for job in matrix.jobs():
        assert Job.from_record(job.to_record()) == job == pickle.loads(pickle.dumps(job))
        assert job.digest == settings_digest(job.settings)
        assert parse_config(job.settings, Path("elsewhere")).to_dict() == job.settings


def test_without_a_name_all_keys_make_it(folder):
    matrix = {"material": ["mirror-silver"], "environment": ["skies/noon.exr"], "sampling.seed": [0, 7]}
    assert names(folder, matrix=matrix) == ["mirror-silver/noon/0", "mirror-silver/noon/7"]


def test_values_of_every_form_have_a_short_name(folder):
    environments = [
        {"emitter": {"type": "constant", "radiance": 2.0}},
        {"file": "skies/noon.exr", "rotation_deg": 90, "name": "noon-turned"},
        {"faces": "skies/cube_{face}.exr"},
    ]
    axes = {
        "environment": environments[:2],
        "material": [{"bsdf": {"type": "conductor"}}],
        "map.resolution": ["auto"],
        "sampling.adaptive": [True],
        "environment.rotation_deg": [1.5],
    }
    found = names(folder, matrix=axes)
    assert found == ["constant/conductor/auto/true/1.5", "noon-turned/conductor/auto/true/1.5"]
    with pytest.raises(InputError, match=r"cube_px\.exr: there is no such environment map"):
        names(folder, matrix={"environment": environments})


def test_a_table_takes_the_place_of_that_of_the_base(folder):
    base = {**BASE, "environment": {"file": "skies/noon.exr", "scale": 3.0}}
    matrix = Matrix.of(batch(folder, base, matrix={"environment": ["skies/dawn.exr"]}))
    matrix.check()
    (job,) = matrix.jobs()
    assert job.settings["environment"] == {
        "file": str(folder / "skies" / "dawn.exr"),
        "rotation_deg": 0.0,
        "scale": 1.0,
    }


def test_paths_start_at_the_file_that_they_stand_in(folder, tmp_path):
    (tmp_path / "base").mkdir()
    (tmp_path / "base" / "bake.toml").write_text('environment = {file = "sky.exr"}\nmaterial = {preset = "solid-red"}')
    (tmp_path / "base" / "sky.exr").write_bytes((folder / "skies" / "dawn.exr").read_bytes())
    (tmp_path / "materials").symlink_to(folder / "materials")
    axes = {"material": [{"file": "materials/c*.xml"}]}
    matrix = Matrix.of(parse_batch({"base": "base/bake.toml", "matrix": axes}, tmp_path))
    matrix.check()
    (job,) = matrix.jobs()
    assert job.settings["environment"]["file"] == str((tmp_path / "base" / "sky.exr").resolve())
    assert job.settings["material"]["file"] == str((folder / "materials" / "chalk.xml").resolve())


def test_exclude_matches_in_part_and_patterns_match_files(folder):
    axes = {"material": ["solid-red", {"file": "materials/*.xml"}], "environment": ["skies/*.exr"]}
    for rule in ({"environment": "skies/dawn.exr"}, {"environment": "dawn"}, {"environment": "d*"}):
        found = names(folder, name="{material}-{environment}", matrix=axes, exclude=[rule])
        assert found == ["solid-red-noon", "chalk-noon", "slate-noon"]
    assert names(folder, matrix=axes, exclude=[{"material": {"file": "materials/*.xml"}}]) == [
        "solid-red/dawn",
        "solid-red/noon",
    ]


def test_include_only_adds(folder):
    """Unlike in other matrices, an included table changes no combination."""
    axes = {"material": ["solid-red"], "map.resolution": [16]}
    rows = [{"material": "solid-red", "map.resolution": 32, "sampling.samples": 64}]
    matrix = Matrix.of(batch(folder, matrix=axes, include=rows, name="{material}-{map.resolution}-{sampling.samples}"))
    matrix.check()
    assert [job.name for job in matrix.jobs()] == ["solid-red-16-16", "solid-red-32-64"]
    assert names(folder, include=[{"material": "metallic-*"}]) == ["metallic-blue", "metallic-silver"]


def test_only_selects_by_values_and_names(folder):
    def only(*texts):
        return names(folder, texts, **WHOLE)

    assert only("material=slate", "map.resolution=32") == ["slate/dawn-32", "slate/noon-32"]
    both = only("material=slate", "material=pearl-white", "environment=noon")
    assert both == ["slate/noon-16", "slate/noon-32", "pearl-white/noon-8"]
    among = only("environment=skies/dawn.exr", "material=s*", "map.resolution=16")
    assert among == ["solid-red/dawn-16", "slate/dawn-16"]
    assert only("sampling.samples=64") == ["pearl-white/noon-8"]
    assert only("name=*/noon-8") == ["pearl-white/noon-8"]


def test_overrides_change_the_base(folder):
    matrix = Matrix.of(batch(folder, **WHOLE), ["sampling.target_error=0.01"])
    matrix.check()
    by_name = {job.name: job.settings["sampling"] for job in matrix.jobs()}
    assert by_name["slate/noon-16"] == {"samples": "auto", "target_error": 0.01, "adaptive": True, "seed": 0}
    assert by_name["pearl-white/noon-8"]["samples"] == 64  # the row's own count takes its place


def test_a_budget_is_a_key_like_any_other(folder):
    base = {**BASE, "sampling": {}, "map": {}}
    found = names(folder, base=base, matrix={"budget.seconds": [30, 60]})
    assert found == ["30", "60"]
    with pytest.raises(InputError, match="decides on the samples"):
        names(folder, base={**base, "sampling": {"target_error": 0.1}}, matrix={"budget.seconds": [30]})


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        ({}, "batch: has no jobs. Give [matrix] or [[include]]"),
        ({"matirx": {}}, "unknown key 'matirx': did you mean 'matrix'?"),
        ({"matrix": {"material": "solid-red"}}, "matrix: material should be a list, in brackets"),
        ({"matrix": {"material": []}}, "matrix: material should hold at least one value"),
        ({"matrix": {"materail": ["solid-red"]}}, "matrix.materail: unknown key 'materail': did you mean 'material'?"),
        (
            {"matrix": {"map.resolutoin": [8]}},
            "matrix.map.resolutoin[1]: unknown key 'map.resolutoin': did you mean 'map.resolution'?",
        ),
        ({"matrix": {"map.resolution": [8, 3]}}, "map.resolution = 3 should be"),
        ({"matrix": {"map.resolution": [8, "16"]}}, 'map.resolution = "16" should be'),
        ({"matrix": {"map.resolution": [8, 16, 8]}}, "map.resolution has '8' twice"),
        ({"matrix": {"material": ["solid-read"]}}, "unknown preset 'solid-read' (did you mean 'solid-red'?)"),
        ({"matrix": {"material": ["metalic-*"]}}, 'material = "metalic-*" matches no preset'),
        ({"matrix": {"material": ["materials/*.xml"]}}, 'Name files with {file = "materials/*.xml"}'),
        ({"matrix": {"material": [3]}}, "material = 3 should be a name in quotes, or a table"),
        ({"matrix": {"material": [{"file": "stuff/*.xml"}]}}, 'material = "stuff/*.xml" matches no file'),
        ({"matrix": {"material": [{"file": "chalk.xml"}]}}, "chalk.xml: there is no such material file"),
        ({"matrix": {"material": [{"file": "skies/noon.exr"}]}}, "noon.exr: is not well-formed XML"),
        ({"matrix": {"material": [{"prest": "solid-red"}]}}, "unknown key 'material.prest': did you mean"),
        ({"matrix": {"environment": ["skies/*.hdr"]}}, 'environment = "skies/*.hdr" matches no file'),
        ({"matrix": {"environment": ["skies/dusk.exr"]}}, "dusk.exr: there is no such environment map"),
        ({"matrix": {"environment": ["materials/chalk.xml"]}}, "is neither OpenEXR nor Radiance HDR: it is text"),
        ({"matrix": {"views.file": ["views.json"]}}, "views.json: cannot be read: No such file or directory"),
        (
            {"matrix": {"environment": ["skies/noon.exr", {"file": "skies/noon.exr", "scale": 2.0}]}},
            "two values of environment are called 'noon' (matrix.environment[1], matrix.environment[2])",
        ),
        ({"name": "{materail}", "matrix": {"material": ["solid-red"]}}, "there is no key 'materail'. Did you mean"),
        ({"name": "{material", "matrix": {"material": ["solid-red"]}}, "has a brace without its partner"),
        (
            {"name": "{material}", "matrix": {"material": ["solid-red"], "sampling.seed": [1, 2]}},
            "two jobs are called 'solid-red': name leaves out sampling.seed",
        ),
        (
            {"matrix": {"material": ["solid-red"]}, "include": [{"material": "solid-red", "sampling.seed": 0}]},
            "two jobs are called 'solid-red/0'",
        ),
        ({"name": "../{material}", "matrix": {"material": ["solid-red"]}}, "none may begin with a dot"),
        ({"name": "/{material}", "matrix": {"material": ["solid-red"]}}, "should be a relative path"),
        ({"name": "results/{material}", "matrix": {"material": ["solid-red"]}}, "a folder of the batch itself"),
        ({"include": [{"material": "pearl-white"}], "exclude": [{"material": "x"}]}, "the rule matches nothing"),
        (
            {"matrix": {"material": ["solid-red"]}, "exclude": [{"materiel": "solid-red"}]},
            "exclude[1]: the matrix has no key 'materiel': the rule matches nothing. Did you mean 'material'?",
        ),
        (
            {"matrix": {"material": ["solid-red"]}, "exclude": [{"material": "solid-rad"}]},
            "exclude[1]: material = 'solid-rad' matches nothing. Did you mean 'solid-red'?",
        ),
        ({"matrix": {"sampling.seed": [1]}, "exclude": [{"sampling.seed": True}]}, "matches nothing"),
        ({"matrix": {"material": ["solid-red"]}, "exclude": [{"material": "solid-red"}]}, "exclude leaves no job"),
        ({"include": [{"material": "nope-*"}]}, "include[1].material: material"),
        ({"include": [{"smapling.samples": 4}]}, "unknown key 'smapling': did you mean 'sampling'?"),
        ({"base": {"material": {}}, "matrix": {"sampling.seed": [1]}}, "the key 'environment' is missing"),
        ({"base": {**BASE, "mpa": {}}, "matrix": {"sampling.seed": [1]}}, "unknown key 'mpa': did you mean 'map'?"),
        ({"base": "nowhere.toml", "matrix": {"sampling.seed": [1]}}, "base = 'nowhere.toml': there is no such config"),
        ({"base": {**BASE, "map": 3}, "matrix": {"map.resolution": [8]}}, "map is not a table"),
        ({"then": {"validate": {"view": 3}}, "matrix": {"sampling.seed": [1]}}, "did you mean 'then.validate.views'?"),
        ({"then": {"publish": "latlong"}, "matrix": {"sampling.seed": [1]}}, "should be a list, in brackets"),
        ({"run": {"theads": 3}, "matrix": {"sampling.seed": [1]}}, "did you mean 'run.threads'?"),
        ({"run": {"threads": 0}, "matrix": {"sampling.seed": [1]}}, "greater than or equal to 1"),
    ],
)
def test_a_mistake_is_one_clear_line(folder, tables, says):
    with pytest.raises(InputError) as refused:
        names(folder, **tables)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_all_mistakes_are_told_at_once(folder):
    axes = {"map.resolution": [8, 1, 2], "material": ["solid-red", "solid-blue"], "sampling.samples": [4, 0]}
    with pytest.raises(InputError) as refused:
        names(folder, matrix=axes)
    told = str(refused.value)
    assert all(one in told for one in ("resolution = 1 ", "resolution = 2 ", "'solid-blue'", "samples = 0 "))
    with pytest.raises(InputError, match="and 12 more mistakes"):
        names(folder, matrix={"sampling.seed": [-n for n in range(1, 21)]})


@pytest.mark.parametrize(
    ("only", "says"),
    [
        (("material=solid-blue",), "no job has material=solid-blue"),
        (("materiel=slate",), "no job has the key 'materiel'. Did you mean 'material'?"),
        (("material=chalk", "map.resolution=32"), "no job has material=chalk map.resolution=32"),
        (("name=nothing",), "no job has name=nothing"),
        (("material",), "sets nothing"),
    ],
)
def test_only_that_selects_nothing_is_a_mistake(folder, only, says):
    with pytest.raises(InputError, match=says.replace("?", r"\?")):
        names(folder, only, **WHOLE)


@pytest.mark.parametrize("text", ["map.resolution=8", "material.preset=solid-red", "environment.scale=2"])
def test_an_override_that_the_matrix_hides_is_a_mistake(folder, text):
    with pytest.raises(InputError, match="is set by the matrix"):
        Matrix.of(batch(folder, **WHOLE), [text])


UNSAFE = ["", "a//b", "/a", "a/", "..", "a/../b", "a\\b", "a\nb", "a\0b", "a\u202eb", ".a", " a", "a/b ", "x.rsibr"]
TAKEN = ["x.rsibr/y", "a.json/b", "lights/a", "Results/a", "reports/a", "published/a"]
LONG = ["é" * 101, "a/" * 600 + "a"]


@pytest.mark.parametrize("name", [*UNSAFE, *TAKEN, *LONG])
def test_a_name_that_is_no_safe_path_is_refused(name):
    assert fault_of(name)


@pytest.mark.parametrize("name", ["a", "a/b-c.2/d e", "results", "éclat/ß", "x.rsibr2", "a" * 200])
def test_a_safe_name_is_taken(name):
    assert fault_of(name) == ""


def test_names_that_some_file_system_confuses_clash():
    register = NameRegister()
    assert [register.clash(name) for name in ("Red/noon", "red/dawn", "a")] == ["", "", ""]
    assert register.clash("rED/NOON") == "two jobs are called 'rED/NOON'"
    assert register.clash("e\u0301") == ""
    assert register.clash("é")  # the same letter, composed
    assert register.folder_clash() == ""
    register.clash("A/b")
    assert register.folder_clash() == "a"


@given(count=st.integers(0, 300), of=st.integers(1, 40))
def test_shards_have_each_job_once(count, of):
    bounds = [shard_bounds((number, of), count) for number in range(1, of + 1)]
    assert [n for one in bounds for n in one] == list(range(count))
    assert max(map(len, bounds)) - min(map(len, bounds)) <= 1


def test_each_distinct_value_is_checked_once(folder):
    axes = {"material": ["solid-red", "pearl-white"], "environment": ["skies/*.exr"], "sampling.seed": list(range(500))}
    matrix = Matrix.of(batch(folder, matrix=axes))
    assert matrix.check() == 2000
    unvaried = len(Config.model_fields) - 1 - 3  # sampling and budget are one group
    assert matrix.checks == 2 + 2 + 500 + unvaried
    assert sum(1 for _ in matrix.jobs()) == 2000
    assert matrix.checks == 2 + 2 + 500 + unvaried


def test_sections_that_are_right_by_themselves_are_right_together():
    """What is checked section by section holds for the whole config: all pairs of sections with a value of each."""
    samples: dict[str, list[Any]] = {
        "environment": [{"emitter": {"type": "sunsky"}, "scale": 2.0}],
        "material": [{"preset": "solid-red", "warp": "normal"}, {"bsdf": {"type": "diffuse"}}],
        "views": [{"subdivision": 2}, {"subdivision": "auto"}, {"file": "/views.json"}],
        "map": [{"resolution": "auto"}, {"resolution": 8}],
        "sampling": [{"samples": 4}, {"target_error": 0.1}, {"time_budget_s": 3.0}, {"clamp": 1.0}],
        "effects": [{"lobes": "off"}, {"polarisation": "on"}, {"diffuse": "off"}],
        "budget": [{"seconds": 3.0}, {"error": 0.1}],
        "plugins": [{"modules": ["json"]}],
        "methods": [{"rsibr": {"option": 3}}],
    }
    assert set(samples) == set(Config.model_fields)
    required = {name: samples[name][0] for name in ("environment", "material")}
    for one, other in product(samples, samples):
        if one == other or {one, other} in map(set, CHECKED_TOGETHER):
            continue
        for first, second in product(samples[one], samples[other]):
            parse_config({**required, one: first, other: second}, Path())
