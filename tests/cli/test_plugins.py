"""Modules that register plugins in Python: named on the command line, recorded in the bake, found again later."""

from __future__ import annotations

import subprocess
import sys

import pytest

import rsibr
from rsibr import backend
from rsibr.scene import python_plugins
from tests.cli.command import write_config
from tests.scene.python_plugin import write_plugin

TEXT = """
[environment]
emitter = {type = "constant", radiance = 0.5}
[material]
bsdf = {type = "chalk-commands", value = 0.25}
[map]
resolution = 8
[sampling]
samples = 16
[effects]
view_dependence = "on"
"""
JUDGED = ("--views", "1", "--samples", "8", "--method", "nearest", "--out", "report")


@pytest.fixture(autouse=True)
def _modules(monkeypatch):
    """Forget the modules of a test at its end."""
    monkeypatch.setattr(python_plugins, "_modules", {})
    monkeypatch.setattr(backend, "_registrations", list(backend._registrations))
    monkeypatch.setattr(backend, "_registered", dict(backend._registered))


def test_a_bake_records_the_module_and_other_processes_find_it(shell, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source, config, out = write_plugin(tmp_path, "my_chalk", "chalk-commands"), write_config(tmp_path, TEXT), "a.rsibr"
    shell.refuses("plan", config, says="name the module that registers it in plugins.modules, or with --import")
    baked = shell("bake", config, "--import", "my_chalk.py", "--out", out)
    assert baked.code == 0, baked.stderr
    bake = rsibr.open_bake(out)
    assert bake.config["plugins"] == {"modules": [str(source)]}
    assert bake.map(0).radiance[3:5, 3:5].mean() == pytest.approx(0.25 * 0.5, rel=0.05)
    command = [sys.executable, "-c", "from rsibr.cli.app import main; main()", "validate", out, *JUDGED]
    found = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert found.returncode == 0, found.stderr
    source.unlink()
    gone = shell.refuses("validate", out, *JUDGED, says=f"plugins.modules: there is no file {source}. Check the path")
    assert gone.stdout == ""


def test_a_plugin_whose_code_has_changed_is_refused_by_validate(shell, tmp_path):
    source, config, out = (
        write_plugin(tmp_path, "chalk", "chalk-commands"),
        write_config(tmp_path, TEXT),
        tmp_path / "b",
    )
    config.write_text(TEXT + '[plugins]\nmodules = ["chalk.py"]\n')
    assert shell("bake", config, "--out", out).code == 0
    source.write_text(source.read_text().replace("dr.inv_pi", "0.5"))
    shell.refuses("validate", out, *JUDGED[:-1], tmp_path / "report", says="the material has changed since the bake")


@pytest.mark.parametrize("command", ["bake", "plan", "validate", "check", "study", "demo"])
def test_every_command_that_loads_scenes_takes_modules(command, shell, tmp_path):
    """One that is no use is one clear line, before any work."""
    config, bad = write_config(tmp_path), tmp_path / "bad.py"
    bad.write_text("x = 1\n")
    if command == "study":
        config.rename(tmp_path / "base.toml")
        config.write_text('base = "base.toml"\n[[sweep]]\nsamples = [16]\n')
    what = [] if command == "demo" else [config]
    out = [] if command in ("plan", "check") else ["--out", tmp_path / "out"]
    shell.refuses(command, *what, *out, "--import", bad, says=f"--import: '{bad}' registers no plugin")
    shell.refuses(command, *what, *out, "--import", "no such", says="should be the name of a module")
    assert not (tmp_path / "out").exists()
