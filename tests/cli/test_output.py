"""What commands print where nobody watches: in pipes and logs, quiet and verbose, with and without colour."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import numpy as np
import pytest

from rsibr.cli.app import app
from rsibr.cli.table import new_table, print_table
from tests.cli.command import CONFIG, write_config
from tests.scene.maps import write_exr

RSIBR = [sys.executable, "-c", "from rsibr.cli.app import main; main()"]
WIDE_TABLE = """
from rsibr.cli.table import new_table, print_table
table = new_table("a", "b")
table.add_column("why", overflow="fold", min_width=20)
table.add_row("x" * 30, "y" * 30, "one two three four five six seven eight nine ten")
print_table(table)
"""


@pytest.fixture
def dark_config(tmp_path):
    """Config of a sky with negative values, on which there is a note."""
    write_exr(tmp_path / "sky.exr", np.linspace(-0.1, 1.0, 96).reshape(4, 8, 3))
    return write_config(tmp_path, CONFIG.replace('emitter = {type = "constant", radiance = 0.5}', 'file = "sky.exr"'))


def on_a_terminal(*command, columns=80, **environment):
    """Output of a command whose stdout and stderr are a terminal."""
    main, other = pty.openpty()
    settings = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "COLUMNS", "TERM")}
    settings |= {"COLUMNS": str(columns), "TERM": "xterm", **environment}
    with subprocess.Popen(command, stdin=other, stdout=other, stderr=other, env=settings) as process:
        os.close(other)
        parts = []
        try:
            while part := os.read(main, 65536):
                parts.append(part)
        except OSError:  # the other end was closed
            pass
        process.wait(timeout=60)
    os.close(main)
    return b"".join(parts).decode()


def test_a_log_holds_progress_as_whole_lines(shell, config, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    ended = shell("bake", config, "--out", tmp_path / "b.rsibr")
    lines = ended.stderr.splitlines()
    assert lines[0] == "bake: preparing"
    assert any(line.startswith("bake: 1 of 12 views (8%)") and line.endswith(" elapsed") for line in lines)
    assert "\x1b" not in ended.stderr
    assert ended.stdout.splitlines()[0].startswith(str(tmp_path / "b.rsibr"))


def test_verbose_says_every_step(shell, config, tmp_path):
    ended = shell("bake", config, "--out", tmp_path / "b.rsibr", "--verbose")
    assert sum(line.startswith("bake: ") and " of 12 views" in line for line in ended.stderr.splitlines()) >= 12
    assert "of memory" in ended.stderr  # the size of a small job


@pytest.mark.parametrize("options", [(["--quiet"], []), ([], ["--quiet"]), (["-q"], []), ([], ["-q"])])
def test_quiet_leaves_results_and_errors(shell, dark_config, tmp_path, options):
    before, after = options
    ended = shell(*before, "bake", dark_config, "--out", tmp_path / "b.rsibr", *after)
    assert ended.code == 0
    assert ended.stderr == ""
    assert "12 views" in ended.stdout
    shell.refuses(*before, "bake", tmp_path / "gone.toml", *after, says="gone.toml")


def test_quiet_and_verbose_contradict_each_other(shell, config):
    shell.refuses("--quiet", "plan", config, "--verbose", says="contradict")
    assert shell("check", config).stderr  # the level of the command before is forgotten


def test_notes_are_said_once(shell, dark_config, tmp_path):
    bake = ["bake", dark_config, "--out", tmp_path / "b.rsibr"]
    said = [shell(*bake, *options).stderr.count("note: sky: ") for options in ([], [], ["--verbose"], [])]
    assert said == [1, 0, 1, 0]


@pytest.mark.parametrize("width", ["40", "80", "200"])
def test_help_cuts_nothing_off(shell, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", width)
    told = " ".join(shell("--help").stdout.split())
    for command in app.registered_commands:
        summary = " ".join((command.callback.__doc__ or "").split("\n\n")[0].split()).split(". ")[0]
        assert summary[:20] in told
        assert summary.split()[-1].rstrip(".") in told.replace("- ", "-")
    assert "..." not in told.split("Commands:")[1]


@pytest.mark.parametrize("command", ["reconstruct", "render", "validate", "compare"])
def test_help_of_method_lists_the_methods(shell, command):
    told = " ".join(shell(command, "--help").stdout.split()).replace("- ", "-")
    assert "nearest, blend, cabral1999, cabral1999-mesh, rsibr, rsibr-fine, miller1984, kautz2003, split-sum" in told


def test_a_table_in_a_pipe_has_one_line_a_row(shell, config, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    lines = shell("plan", config).stdout.splitlines()
    assert lines[0].startswith("effect")
    assert "…" not in "".join(lines)
    (diffuse,) = (line for line in lines if line.startswith("diffuse  "))
    assert diffuse.endswith("a matte lobe: it follows the normal [of the reflected light]")
    assert not any(line != line.rstrip() for line in lines)


def test_a_table_without_a_terminal_is_never_wrapped(capsys):
    table = new_table("a", "b", title="t")
    table.add_row("x" * 300, "y z")
    print_table(table)
    title, headings, line, row = capsys.readouterr().out.splitlines()
    assert (title, headings.split(), row.split()) == ("t", ["a", "b"], ["x" * 300, "y", "z"])
    assert set(line) == {"─"}


def test_a_table_on_a_narrow_terminal_is_folded_and_not_cut_off():
    told = on_a_terminal(sys.executable, "-c", WIDE_TABLE, columns=40)
    assert "x" * 30 in told
    assert "…" not in told
    assert all(word in told for word in ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"])
    assert len([line for line in told.splitlines() if line.strip()]) > 3  # folded


@pytest.mark.parametrize(("settings", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)])
def test_colour_is_for_terminals_that_may_have_it(settings, coloured):
    told = on_a_terminal(*RSIBR, "bake", "gone.toml", **settings)
    assert "error: gone.toml: there is no such config" in told
    assert ("\x1b[31m" in told) is coloured
