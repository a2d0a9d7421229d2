"""Pages are held to the code: links, names, commands, options and keys on them are there, and examples run."""

from __future__ import annotations

import importlib
import re
import shlex
import tomllib
import typing
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
import typer
from pydantic import BaseModel

import rsibr
from rsibr.cli.app import app
from rsibr.methods.protocol import Method
from rsibr.methods.registry import registration, unregister
from rsibr.scene.config import Config
from rsibr.store.bake import open_bake
from rsibr.store.manifest import Manifest
from tests.documentation import DOCS, GENERATED, ROOT, Page, front_pages, pages
from tests.store import synthetic

ALL = [*front_pages(), *pages()]
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]
SETS_A_KEY = re.compile(r"--set[ =](\w+(?:\.\w+)+)=")


def each(found: list[Page]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("page", found, ids=lambda page: page.name)


def page(name: str) -> Page:
    return Page(DOCS / name)


def test_every_page_is_in_a_toctree_and_every_entry_is_a_page():
    entries = {entry for one in pages() for entry in one.entries()}
    found = {str(one.path.relative_to(DOCS).with_suffix("")) for one in pages()} - {"index"}
    assert found - {name for name in found if any(fnmatch(name, entry) for entry in entries)} == set()
    notebooks = {f"notebooks/{file.stem}" for file in (ROOT / "notebooks").glob("*.ipynb")}
    assert {entry for entry in entries if "*" not in entry} == found | notebooks
    assert {entry for entry in entries if "*" in entry} == {"reference/public/*", "reference/rooms/*"}


@each(ALL)
def test_every_link_leads_somewhere(page):
    for link in page.links():
        file, _, anchor = link.partition("#")
        target = (page.path.parent / file).resolve() if file else page.path
        if target.is_relative_to(DOCS / GENERATED[0]):  # notebooks, which the build copies
            target = ROOT / target.relative_to(DOCS)
        assert target.exists(), link
        if anchor:
            assert anchor in headings(Page(target)), link


def headings(page: Page) -> set[str]:
    titles = re.findall(r"^#+ (.+)$", page.prose, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def names_on(page: Page) -> Iterator[str]:
    """Dotted names of rsibr in code, and what code blocks import from it."""
    blocks = page.blocks("python")
    for text in [*page.inline_code(), *blocks]:
        found = re.findall(r"(?<![\w./*-])rsibr(?:\.[A-Za-z_]\w*)+", text)
        yield from (name for name in found if not name.endswith(".py"))
    for module, imported in re.findall(r"^from (rsibr[\w.]*) import (.+)$", "\n".join(blocks), re.MULTILINE):
        yield from (f"{module}.{name.split(' as ')[0].strip()}" for name in imported.split("#")[0].split(","))


@each([one for one in ALL if one.path.name != "CHANGELOG.md"])
def test_every_name_of_rsibr_exists(page):
    for name in set(names_on(page)):
        assert is_there(name), name


def test_every_new_name_of_the_change_log_exists():
    """The old names stand in the left column."""
    rows = re.findall(r"^\| (`rsibr\..*?) \| (`rsibr\..*) \|$", Page(ROOT / "CHANGELOG.md").text, re.MULTILINE)
    assert len(rows) > 10
    for _, new in rows:
        for name in re.findall(r"`(rsibr[\w.]+)`", new):
            assert is_there(name), name


def is_there(name: str) -> bool:
    """Whether a dotted name is a module, or can be had from one."""
    found: object = rsibr
    path = "rsibr"
    for part in name.split(".")[1:]:
        path = f"{path}.{part}"
        try:
            found = getattr(found, part) if hasattr(found, part) else importlib.import_module(path)
        except ImportError:
            return False
    return True


def commands_on(page: Page) -> Iterator[list[str]]:
    """Command lines of `rsibr` in blocks and in inline code, as words; a placeholder stays a word."""
    lines = [line for block in page.blocks("sh") for line in block.splitlines()]
    for line in [*lines, *page.inline_code()]:
        if re.match(r"rsibr( [a-z-]|$)", line):
            yield shlex.split(line, comments=True)[1:]


@each(ALL)
def test_every_command_has_the_options_it_is_shown_with(page):
    for words in commands_on(page):
        while words and words[0] in ("--quiet", "--verbose"):
            words = words[1:]  # noqa: PLW2901
        if not words or words[0].startswith("-"):
            assert set(words[:1]) <= {"--version", "--help", "--install-completion", "--show-completion"}, words
            continue
        assert words[0] in COMMANDS, words
        known = options_of(*words[:2]) | {"--help"}
        given = {word.split("=")[0] for word in words[1:] if word.startswith("--")}
        assert given <= known, f"{words}: {given - known}"


def options_of(command: str, subcommand: str = "") -> set[str]:
    """Options of a command, or of a subcommand where the command is a group."""
    found = COMMANDS[command]
    found = getattr(found, "commands", {}).get(subcommand, found)
    names = (name for parameter in found.params for name in (*parameter.opts, *parameter.secondary_opts))
    return {name for name in names if name.startswith("--")}


@each(ALL)
def test_every_config_that_a_command_names_is_there(page):
    for words in commands_on(page):
        for file in (word for word in words if word.startswith("configs/")):
            assert (ROOT / file).is_file(), file


@each(ALL)
def test_every_key_that_is_set_is_a_key_of_the_config(page):
    for key in SETS_A_KEY.findall(page.text):
        assert key in keys(), key


@each(ALL)
def test_every_block_of_toml_is_toml(page):
    for block in page.blocks("toml"):
        tomllib.loads(block)


def keys() -> set[str]:
    """Dotted keys of a config, without options of methods, which their factories have."""
    return {f"{name}.{key}" for name, section in sections().items() for key in section.model_fields}


def sections() -> dict[str, type[BaseModel]]:
    found = {}
    for name, field in Config.model_fields.items():
        candidates = [field.annotation, *typing.get_args(field.annotation)]
        models = [one for one in candidates if isinstance(one, type) and issubclass(one, BaseModel)]
        found |= {name: models[0]} if models else {}
    return found


def test_the_page_of_the_config_has_every_key():
    text = page("config.md").text
    for name, section in sections().items():
        part = text.partition(f"## `[{name}]`")[2].partition("\n## ")[0]
        assert part, name
        assert set(section.model_fields) - set(re.findall(r"`(\w+)`", part)) == set(), name


def test_the_page_of_the_command_line_has_every_option():
    text = page("command-line.md").text
    for name in COMMANDS:
        assert f"rsibr {name}" in text
        part = text.partition(f"## `rsibr {name}")[2].partition("\n## ")[0]
        shared = {"--json", "--help", "--import", "--quiet", "--verbose"}
        assert options_of(name) - shared - set(re.findall(r"--[a-z-]+", part)) == set(), name
    assert all(f"`{option}" in text for option in ("--json", "--help", "--quiet", "--verbose", "--show-completion"))


def test_the_page_of_the_command_line_says_who_takes_plugins():
    (sentence,) = re.findall(r"(`bake`, [^.]*) take it", page("command-line.md").text)
    assert set(re.findall(r"`(\w+)`", sentence)) == {name for name in COMMANDS if "--import" in options_of(name)}


def test_the_page_of_the_file_format_has_every_field_of_the_manifest():
    rows = re.findall(
        r"^\| `(\w+)(?:\[\])?` \|", page("file-format.md").text.partition("`manifest.json`\n")[2], re.MULTILINE
    )
    assert set(rows) == {*Manifest.model_fields, "checksum"}


def test_the_page_of_python_has_every_public_name():
    text = page("how-to/python.md").text
    assert {name for name in rsibr.__all__ if name != "__version__" and f"`rsibr.{name}`" not in text} == set()


def test_the_readme_is_one_page():
    assert len(Page(ROOT / "README.md").text.splitlines()) <= 120


@pytest.mark.parametrize("file", [*(one.path for one in ALL), *(ROOT / "notebooks").glob("*.ipynb")], ids=str)
def test_no_path_of_a_machine_is_named(file):
    assert re.findall(r"(?<![\w.])/(?:home|root|work|tmp|Users|mnt)/\S*", file.read_text(encoding="utf-8")) == []


def test_the_version_is_the_same_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["version"] == rsibr.__version__
    assert f"\nversion: {rsibr.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## [{rsibr.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def run(block: str, **names: object) -> dict[str, object]:
    exec(compile(block, "example", "exec"), names)
    return names


def test_the_example_of_a_method_is_a_method():
    (block, *_) = page("extend/method.md").blocks("python")
    try:
        run(block)
        made = registration("grey").make(None)
        assert isinstance(made, Method)
        radiance = made.eval(mi.Vector3f(0, 0, 1), mi.Vector3f(0, 0.6, 0.8))
        np.testing.assert_array_equal(np.array(radiance).ravel(), 0.5)
    finally:
        unregister("grey")


def test_the_example_of_an_effect_decides(capsys):
    (block,) = page("extend/effect.md").blocks("python")
    found = run(block)["found"]
    assert not found.on  # type: ignore[attr-defined]
    assert found.evidence == pytest.approx(0.01 / 1.01)  # type: ignore[attr-defined]
    assert "next to no light" in capsys.readouterr().out


def test_the_example_of_a_material_samples_what_it_evaluates():
    (block,) = page("extend/material.md").blocks("python")
    run(block)
    bsdf = mi.load_dict({"type": "dust", "scattering": 0.9})
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f(0.6, 0, 0.8)
    rng = np.random.default_rng(1)
    pairs = mi.Point2f(rng.random((2, 2**16)).astype(np.float32))
    _, weight = bsdf.sample(mi.BSDFContext(), si, 0.5, pairs)
    # ∫ w μ / (4π (μ + μ_o)) dω = w/2 (1 − μ_o ln(1 + 1/μ_o)): half a percent is five standard errors
    expected = 0.45 * (1 - 0.8 * np.log(1 + 1 / 0.8))
    assert np.array(weight).mean() == pytest.approx(expected, rel=5e-3)


def test_the_example_of_an_exporter_writes_what_the_bake_holds(tmp_path: Path):
    synthetic.write(tmp_path / "paint.rsibr")
    bake = open_bake(tmp_path / "paint.rsibr")
    export = run(page("extend/exporter.md").blocks("python")[0])["export_rgba"]
    written = export(bake, tmp_path / "rgba")  # type: ignore[operator]
    assert len(written) == bake.view_count
    with OpenEXR.File(str(written[1])) as file:
        pixels = file.channels()["RGBA"].pixels
    stored = bake.map(1)
    inside = stored.coverage > 0
    np.testing.assert_array_equal(pixels[inside][:, :3], stored.radiance[inside])
    np.testing.assert_array_equal(pixels[..., 3], stored.coverage)


def test_the_example_of_a_reader_needs_no_rsibr(tmp_path: Path):
    synthetic.write(tmp_path / "paint.rsibr")
    reader = page("how-to/other-programs.md").blocks("python")[0].partition("\nfor path")[0]
    radiance, coverage, frame = run(reader)["read_map"](tmp_path / "paint.rsibr" / "maps" / "view_0002.exr")  # type: ignore[operator]
    stored = open_bake(tmp_path / "paint.rsibr").map(2)
    np.testing.assert_array_equal(radiance, stored.radiance)
    np.testing.assert_array_equal(coverage, stored.coverage)
    np.testing.assert_array_equal(frame, stored.frame)
